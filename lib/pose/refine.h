// Non-linear refinement of one camera pose on 2D-3D matches.
#pragma once

#include <optional>
#include <vector>

#include "geometry/camera.h"
#include "geometry/rigid.h"
#include "pose/ransac.h"

namespace vantage::pose {

// Reprojection error of a match, pixels; +inf behind the camera.
double ReprojectionError(const Match2d3d& match, const geometry::PinholeCamera& camera, const geometry::Rigid& T_camera_object);

// Minimises the Cauchy-weighted reprojection error of the matches `index`, and the depth error of those that have a measured depth,
// by Gauss-Newton. `scale_px` is the error at which a match weighs half. Returns the start where fewer than 3 matches are usable.
// Cost: about 10 us an iteration at 100 matches.
geometry::Rigid RefinePose(const std::vector<Match2d3d>& matches, const std::vector<int>& index,
                           const geometry::PinholeCamera& camera, const geometry::Rigid& T_camera_object, double scale_px,
                           int iterations = 10);

// Where something else (a mount) says the object is, and how well it knows: standard deviations of the object's origin and of its
// axes.
struct PosePrior {
  geometry::Rigid T_camera_object = geometry::Rigid::Identity();
  double sigma_m = 0.005;
  double sigma_rad = 0.01;
};

// How well a pose is held: standard deviations of the object's origin and of its axes in the worst direction.
struct PoseSpread {
  double sigma_m = 0.0;
  double sigma_rad = 0.0;
};

// Of the pose that the matches `index` agree on, where each is off by `pixel_sigma` in each direction (and by DepthNoise where it
// has a measured depth), and of which something else (a DenseFit) knows `other_information`. Infinite where they leave a
// direction open. Few points on a small flat part hold a pose badly, however well they fit.
PoseSpread SpreadOfPose(const std::vector<Match2d3d>& matches, const std::vector<int>& index, const geometry::PinholeCamera& camera,
                        const geometry::Rigid& T_camera_object, double pixel_sigma,
                        const Eigen::Matrix<double, 6, 6>& other_information = Eigen::Matrix<double, 6, 6>::Zero());

}  // namespace vantage::pose
