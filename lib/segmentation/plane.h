// Dominant-plane estimation: finds the table so that objects can be cut out.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>

#include "rgbd/frame.h"

namespace vantage::segmentation {

struct PlaneParams {
  double max_distance_m = 0.01;  // Inlier band around the plane; > 0.
  double confidence = 0.99;      // P(one sample is all inliers); in (0, 1).
  int max_iterations = 500;      // Cap on RANSAC samples; >= 1.
  int step_px = 4;               // Only every n-th pixel is used; >= 1.
  double min_share = 0.15;       // A plane with a smaller share of the points is no table; (0, 1].
  double min_size_m = 0.15;  // Neither is one that spreads over less than this (deviation of its points * sqrt 12, across); >= 0.
  double max_depth_m = 2.5;  // Points further away are not used; > 0.
  double min_up = 0.15;      // A table's normal has at least this cosine with the image's up; else it is a wall; [-1, 1].

  void Check() const;  // Throws std::invalid_argument naming the first field out of range.
};

struct Plane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // Unit length; points to the side of the camera.
  double offset_m = 0.0;                              // normal.dot(x) + offset_m == 0 on the plane; height above it elsewhere.
  double share = 0.0;                                 // Of the points used.
  double Height(const Eigen::Vector3d& x) const { return normal.dot(x) + offset_m; }
};

// The plane that most points support (RANSAC; PCL, seed fixed), refined on its inliers. Camera coordinates. Where that looks like a
// wall (a camera held upright and looking down sees walls lean towards the image's bottom), the largest that does not is taken
// instead, if there is one among the next few; where it is the floor under a table (another lies level, far above it), the table.
// nullopt where there is none with `min_share` and `min_size_m`, or the frame has no depth. About 4 ms for 640x480.
std::optional<Plane> FitPlane(const rgbd::Frame& frame, const PlaneParams& params);

}  // namespace vantage::segmentation
