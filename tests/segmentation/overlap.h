// What tests of segmentation measure clusters by.
#pragma once

#include <algorithm>
#include <vector>

#include "segmentation/clusters.h"
#include "segmentation/plane.h"

namespace vantage::segmentation {

inline double IntersectionOverUnion(const cv::Mat& a, const cv::Mat& b) {
  return cv::countNonZero(a & b) / static_cast<double>(std::max(1, cv::countNonZero(a | b)));
}

// Of the cluster that fits the mask best.
inline double BestOverlap(const std::vector<Cluster>& clusters, const cv::Mat& mask) {
  double best = 0.0;
  for (const Cluster& cluster : clusters) best = std::max(best, IntersectionOverUnion(cluster.mask, mask));
  return best;
}

// None where there is no table.
inline std::vector<Cluster> Segment(const rgbd::Frame& frame, const ClusterParams& params = {}) {
  const std::optional<Plane> plane = FitPlane(frame, {});
  return plane ? FindClusters(frame, *plane, params) : std::vector<Cluster>{};
}

}  // namespace vantage::segmentation
