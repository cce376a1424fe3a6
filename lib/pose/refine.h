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

// How well matches hold a pose: standard deviations of the object's origin and of its axes in the worst direction.
struct PoseSpread {
  double sigma_m = 0.0;
  double sigma_rad = 0.0;
};

// Of the pose that the matches `index` agree on, where each is off by `pixel_sigma` in each direction (and by DepthNoise where it
// has a measured depth). Infinite where they leave a direction open. Few points on a small flat part hold a pose badly, however
// well they fit.
PoseSpread SpreadOfPose(const std::vector<Match2d3d>& matches, const std::vector<int>& index, const geometry::PinholeCamera& camera,
                        const geometry::Rigid& T_camera_object, double pixel_sigma);

// A point of the object's surface; object frame, metres, unit normal outward.
struct SurfacePoint {
  Eigen::Vector3d point;
  Eigen::Vector3d normal;
};

// Where something else (a mount) says the object is, and how well it knows: standard deviations of the object's origin and of its
// axes.
struct PosePrior {
  geometry::Rigid T_camera_object = geometry::Rigid::Identity();
  double sigma_m = 0.005;
  double sigma_rad = 0.01;
};

// As above, and the surface is drawn to the frame's depth image (point to plane, projective association; samples further than 2 cm
// from it do not count), the pose to the prior. The start must be within a centimetre or so.
geometry::Rigid RefinePoseOnSurface(const std::vector<Match2d3d>& matches, const std::vector<int>& index,
                                    const std::vector<SurfacePoint>& surface, const rgbd::Frame& frame,
                                    const std::optional<PosePrior>& prior, const geometry::Rigid& T_camera_object, double scale_px,
                                    int iterations = 10);

// What depth alone says about a pose.
struct SurfaceFit {
  geometry::Rigid T_camera_object = geometry::Rigid::Identity();
  Eigen::Matrix<double, 6, 6> information;  // Of the step (translation, rotation vector) in camera coordinates; may be singular.
  int samples = 0;                          // That were measured near enough.
};

// The pose that draws the surface to the frame's depth image (as above, but nothing else speaks). Where the surface could slide
// along itself the pose stays; the information says which way. Neighbouring depths err together: all samples count as much as
// `independent` ones at most. Cost: about 0.2 ms for 300 samples.
SurfaceFit FitSurface(const std::vector<SurfacePoint>& surface, const rgbd::Frame& frame, const geometry::Rigid& T_camera_object,
                      double independent, int iterations = 6);

}  // namespace vantage::pose
