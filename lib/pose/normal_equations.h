// Weighted least squares in the six degrees of freedom of one pose. Internal to pose.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "geometry/rigid.h"
#include "pose/depth_noise.h"
#include "pose/ransac.h"

namespace vantage::pose {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

inline Eigen::Matrix3d Cross(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

// exp(delta) * T for delta = (translation, rotation vector) in camera coordinates.
inline geometry::Rigid Perturbed(const geometry::Rigid& T, const Vector6d& delta) {
  geometry::Rigid step = geometry::Rigid::Identity();
  const double angle = delta.tail<3>().norm();
  if (angle > 1e-12) step.linear() = Eigen::AngleAxisd(angle, delta.tail<3>() / angle).toRotationMatrix();
  step.translation() = delta.head<3>();
  return step * T;
}

// Sums over residuals; jacobians are by a step as of Perturbed.
struct NormalEquations {
  Matrix6d hessian = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
  int matches = 0;
  int samples = 0;

  void Add(const Vector6d& jacobian, double residual, double weight) {
    hessian.noalias() += weight * jacobian * jacobian.transpose();
    gradient.noalias() += weight * residual * jacobian;
  }
  // The same, counting for `share` of what it says.
  void AddScaled(const NormalEquations& other, double share) {
    hessian += share * other.hessian;
    gradient += share * other.gradient;
    matches += other.matches;
    samples += other.samples;
  }
};

// Steps in metres and radians below which a pose has settled.
constexpr double kSmallestStep = 1e-6;

// Holds directions in which the object could slide by a weight that is little beside any in which it could not.
inline void HoldWhatSlides(const geometry::Rigid& T, NormalEquations* equations) {
  constexpr double kObjectSize_m = 0.03;
  const double held = 1e-4 * equations->hessian.topLeftCorner<3, 3>().trace();
  // A turn is one about the object's origin, not the camera's: that would carry a plain wall along itself.
  Eigen::Matrix<double, 3, 6> of_origin;
  of_origin << Eigen::Matrix3d::Identity(), -Cross(T.translation());
  equations->hessian += held * of_origin.transpose() * of_origin;
  equations->hessian.diagonal().tail<3>().array() += held * kObjectSize_m * kObjectSize_m;
}

// The weight of a squared error where one of `scale` weighs half.
inline double Cauchy(double squared, double scale) { return 1.0 / (1.0 + squared / (scale * scale)); }

// Gauss-Newton; `add` puts all residuals at a pose into the equations. The start where neither three matches nor six samples took
// part or the equations do not solve.
template <typename AddAll>
geometry::Rigid GaussNewton(const geometry::Rigid& start, int iterations, const AddAll& add) {
  geometry::Rigid T = start;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    NormalEquations equations;
    add(T, &equations);
    if (equations.matches < 3 && equations.samples < 6) return start;
    equations.hessian.diagonal() *= 1.0 + 1e-6;
    const Vector6d delta = -equations.hessian.ldlt().solve(equations.gradient);
    if (!delta.allFinite()) return start;
    T = Perturbed(T, delta);
    if (delta.norm() < kSmallestStep) break;
  }
  return T;
}

// Reprojection error, and depth error where depth was measured; a pixel weighs as much as a standard deviation of depth.
inline void AddMatch(const Match2d3d& match, const geometry::PinholeCamera& camera, const geometry::Rigid& T, double scale_px,
                     NormalEquations* equations) {
  const Eigen::Vector3d p = T * match.point;
  if (!(p.z() > 1e-3)) return;
  const double inverse_z = 1.0 / p.z();
  const Eigen::Vector2d residual(camera.fx * p.x() * inverse_z + camera.cx - match.pixel.x(),
                                 camera.fy * p.y() * inverse_z + camera.cy - match.pixel.y());
  Eigen::Matrix<double, 2, 3> projection;
  projection << camera.fx * inverse_z, 0, -camera.fx * p.x() * inverse_z * inverse_z, 0, camera.fy * inverse_z,
      -camera.fy * p.y() * inverse_z * inverse_z;
  Eigen::Matrix<double, 2, 6> jacobian;
  jacobian.leftCols<3>() = projection;
  jacobian.rightCols<3>() = -projection * Cross(p);
  const double weight = Cauchy(residual.squaredNorm(), scale_px);
  for (int axis = 0; axis < 2; ++axis) equations->Add(jacobian.row(axis).transpose(), residual(axis), weight);
  ++equations->matches;
  if (match.depth_m <= 0.0) return;
  const double inverse_sigma = 1.0 / DepthNoise{}.Sigma(match.depth_m);
  const double error = (p.z() - match.depth_m) * inverse_sigma;
  Vector6d depth_jacobian;
  depth_jacobian << 0, 0, 1, p.y(), -p.x(), 0;
  equations->Add(depth_jacobian * inverse_sigma, error, Cauchy(error * error, 2.0));
}

}  // namespace vantage::pose
