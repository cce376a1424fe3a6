// Connected surfaces, several of which may make up one object. Internal to segmentation.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "segmentation/plane.h"

namespace vantage::segmentation {

struct Part {
  std::vector<cv::Point> pixels;
  std::vector<Eigen::Vector3d> points;    // In the order of pixels, as are the next two; camera coordinates, metres.
  std::vector<cv::Point2f> footprint_cm;  // The points seen from above, in the plane.
  std::vector<float> heights_m;           // Above the plane.
  std::vector<cv::Point2f> hull_cm;       // Convex hull of the footprint.
  double low_m = 0.0, high_m = 0.0;       // Range of heights.
  double top_m = 0.0;                     // The height under which all points but 2 % lie.
  std::vector<int> surfaces;              // Labels of what it was made of.
};

// Of pixels and their points.
Part MakePart(std::vector<cv::Point> pixels, std::vector<Eigen::Vector3d> points, const Plane& plane);
Part Join(const Part& a, const Part& b);
Eigen::Vector3d Centroid(const std::vector<Eigen::Vector3d>& points);

// The longest side of the points' box along their principal axes, metres; of many points a sample.
double LongestSide(const std::vector<Eigen::Vector3d>& points);

}  // namespace vantage::segmentation
