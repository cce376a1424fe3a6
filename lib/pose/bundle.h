// Bundle adjustment: camera poses and object points together, over reprojection and measured depth (section III).
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "geometry/camera.h"
#include "geometry/rigid.h"
#include "pose/depth_noise.h"
#include "pose/refine.h"

namespace vantage::pose {

struct BundleView {
  geometry::Rigid T_camera_object = geometry::Rigid::Identity();
  geometry::PinholeCamera camera;
  bool fixed = false;              // Its pose is held: the gauge.
  std::optional<PosePrior> prior;  // Where something else says the object is.
};

struct BundleObservation {
  int view = 0;           // Index into views.
  int point = 0;          // Index into points.
  Eigen::Vector2d pixel;  // Where the view saw the point, pixels of the view's camera.
  double depth_m = 0.0;   // Measured there along z, metres; 0 = none.
};

using Matrix6d = Eigen::Matrix<double, 6, 6>;

// Two views' relative pose as measured by something else than points (their surfaces). `information` (inverse covariance) is of the
// step (translation, metres; rotation vector, radians) in view b's camera coordinates from T_b_a to the present relative pose; it
// may be singular, as where a surface slides along itself.
struct BundleRelation {
  int view_a = 0;  // Index into views.
  int view_b = 0;
  geometry::Rigid T_b_a = geometry::Rigid::Identity();
  Matrix6d information = Matrix6d::Zero();
};

struct BundleProblem {
  std::vector<BundleView> views;
  std::vector<Eigen::Vector3d> points;  // Object frame, metres.
  std::vector<BundleObservation> observations;
  std::vector<BundleRelation> relations;
};

struct BundleParams {
  double pixel_sigma = 0.7;    // Standard deviation of an interest point in each direction, pixels; > 0.
  DepthNoise depth_noise;      // Of a measured depth.
  double robust_sigmas = 2.0;  // Cauchy: an error of so many standard deviations weighs half; > 0.
  int max_iterations = 30;     // Of all stages together; >= 1. Bounds the time: a clock would make results differ.
  double max_anneal = 16.0;    // The robust scale starts up to so many times wider where the start is bad; >= 1.
  double tolerance = 1e-5;     // Converged where the cost falls by a smaller share in an iteration; > 0.

  void Check() const;  // Throws std::invalid_argument naming the field.
};

struct BundleReport {
  int observations = 0;       // That took part.
  int points = 0;             // That were free.
  int views = 0;              // That were free.
  double initial_cost = 0.0;  // Half the sum of the robust squared errors, in standard deviations.
  double final_cost = 0.0;
  double initial_rms_px = 0.0;  // Over observations within 3 robust scales at the end (the same ones before and after).
  double final_rms_px = 0.0;
  double initial_rms_depth_m = 0.0;  // Likewise, over measured depths.
  double final_rms_depth_m = 0.0;
  double inlier_share = 0.0;  // Of the observations: those within 3 robust scales at the end.
  int iterations = 0;         // Of all stages.
  bool converged = false;     // The last stage ended by its tolerance; true where there was nothing to do.
};

// Minimises sum Cauchy(reprojection / pixel_sigma) + sum Cauchy((z - depth_m) / sigma(depth_m)) + Cauchy(relations) + priors over
// the poses of the views that are not fixed and over all points two or more views see (Triggs et al., "Bundle adjustment: a modern
// synthesis", 1999), by Levenberg-Marquardt with the points eliminated (Ceres; one thread, the same result every time).
//
// Left as they are: points that fewer than two views or fixed views alone see, free views without prior and relation that see
// fewer than three shared points. Left out: observations with a bad index, a value that is not finite, or a point behind the camera
// at the start. Where no view is fixed and none has a prior, the first one is held. The cost never rises. Without any depth the
// scale is what the start says. Cost: about 0.3 s for 40 views, 3000 points, 12000 observations on one core.
BundleReport AdjustBundle(BundleProblem* problem, const BundleParams& params);

}  // namespace vantage::pose
