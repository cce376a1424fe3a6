// Interest points with descriptors, and their matching.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace vantage::features {

struct FeatureParams {
  std::string type = "sift";         // "sift" (OpenCV, square-rooted to RootSIFT, 128 values) or "surf" (dlib, 64 values).
  int max_keypoints = 3000;          // Strongest kept per image; >= 1.
  double contrast_threshold = 0.02;  // Of SIFT's extrema, and of the blobs that SURF sees: share of the grey range; lower finds
                                     // more and weaker points; > 0.

  void Check() const;               // Throws std::invalid_argument naming the field.
  std::string Fingerprint() const;  // Equal where descriptors and repeatability are comparable.
};

struct Features {
  std::vector<cv::KeyPoint> keypoints;  // Pixels of the image given; size = diameter, angle in degrees.
  cv::Mat descriptors;                  // One row per keypoint, CV_32F, unit length.

  int size() const { return static_cast<int>(keypoints.size()); }
};

// Detects and describes. `mask` (CV_8UC1, empty = everywhere) restricts the points; the work is done only in its bounding box plus
// a margin. Order: as the detector gives them (deterministic). Cost: about 160 ms (SURF 60) for 512 x 384 and 1000 points on one
// thread.
Features Extract(const cv::Mat& gray, const cv::Mat& mask, const FeatureParams& params);

// The rows `index` of a set.
Features Select(const Features& features, const std::vector<int>& index);

struct Match {
  int query = 0;
  int train = 0;
  float distance = 0.f;  // Euclidean, between unit descriptors: [0, 2].
};

// The best and second-best train row of a query row; -1 where there is none, then the distance is 2.
struct NearestPair {
  int best = -1;
  int second = -1;
  float best_distance = 2.f;
  float second_distance = 2.f;
};

// The nearest train rows of every query row (both CV_32F, unit rows of one length). `groups` (one int per train
// row, may be empty): the second best is sought outside the group of the best, so that views of one physical point do not compete.
// Exhaustive: about 80 ms for 3000 x 4000 rows of 128 on one core.
std::vector<NearestPair> NearestTwo(const cv::Mat& query, const cv::Mat& train, const std::vector<int>& groups = {});

// Matches whose best distance is below `max_ratio` times the second best and below `max_distance`.
std::vector<Match> MatchRatio(const cv::Mat& query, const cv::Mat& train, double max_ratio, double max_distance = 1.2);

}  // namespace vantage::features
