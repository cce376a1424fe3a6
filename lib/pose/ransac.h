// Robust camera pose from 2D-3D matches: P3P inside RANSAC (sections III, IV-C).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "geometry/camera.h"
#include "geometry/rigid.h"
#include "rgbd/frame.h"

namespace vantage::pose {

struct RansacParams {
  double inlier_px = 3.0;           // Reprojection error of an inlier; > 0.
  double failure_rate = 0.001;      // eta_0 of equation (8): stop when a correct pose was missed with less than this; (0, 1).
  int min_iterations = 100;         // Of a cluster, however much of it is explained; >= 1.
  int min_joint_iterations = 500;   // Of clusters not yet explained, however much of the image is: hidden objects need them; >= 1.
  int max_iterations = 10000;       // Of any cluster; 6905 find 10 % of inliers; >= min_iterations.
  double max_depth_error_m = 0.03;  // |dz| between an inlier's point and the depth image that still supports a pose; > 0.
  double min_depth_support = 0.5;   // Share of the sampled and inlying points with depth that must be supported; [0, 1].

  void Check() const;  // Throws std::invalid_argument naming the field.
};

struct Match2d3d {
  Eigen::Vector2d pixel;
  Eigen::Vector3d point;  // Object frame, metres.
  double depth_m = 0.0;   // Measured depth (z) at the pixel, metres; 0 = none. Used by refinement only.
};

struct PoseEstimate {
  geometry::Rigid T_camera_object = geometry::Rigid::Identity();
  std::vector<int> inliers;  // Indices into the matches, ascending.
  int iterations = 0;
  int depth_rejected = 0;  // Hypotheses that the depth image contradicted.
};

// nullopt where fewer than 4 matches or no pose with at least 4 inliers was found. `depth` may be null: no depth check.
// The result is refined on its inliers. The case of one cluster of EstimatePoses (multi_ransac.h), with its cost.
std::optional<PoseEstimate> EstimatePose(const std::vector<Match2d3d>& matches, const geometry::PinholeCamera& camera,
                                         const rgbd::Frame* depth, const RansacParams& params, std::uint32_t seed);

}  // namespace vantage::pose
