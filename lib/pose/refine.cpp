#include "pose/refine.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

namespace vantage::pose {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

Eigen::Matrix3d Cross(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

// exp(delta) * T for delta = (translation, rotation vector) in camera coordinates.
geometry::Rigid Perturbed(const geometry::Rigid& T, const Vector6d& delta) {
  geometry::Rigid step = geometry::Rigid::Identity();
  const double angle = delta.tail<3>().norm();
  if (angle > 1e-12) step.linear() = Eigen::AngleAxisd(angle, delta.tail<3>() / angle).toRotationMatrix();
  step.translation() = delta.head<3>();
  return step * T;
}

}  // namespace

double ReprojectionError(const Match2d3d& match, const geometry::PinholeCamera& camera, const geometry::Rigid& T_camera_object) {
  const auto pixel = camera.Project(T_camera_object * match.point);
  return pixel ? (*pixel - match.pixel).norm() : std::numeric_limits<double>::infinity();
}

geometry::Rigid RefinePose(const std::vector<Match2d3d>& matches, const std::vector<int>& index,
                           const geometry::PinholeCamera& camera, const geometry::Rigid& T_camera_object, double scale_px,
                           int iterations) {
  geometry::Rigid T = T_camera_object;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    Matrix6d hessian = Matrix6d::Zero();
    Vector6d gradient = Vector6d::Zero();
    int used = 0;
    for (const int i : index) {
      const Eigen::Vector3d p = T * matches[i].point;
      if (!(p.z() > 1e-3)) continue;
      const double inverse_z = 1.0 / p.z();
      const Eigen::Vector2d residual(camera.fx * p.x() * inverse_z + camera.cx - matches[i].pixel.x(),
                                     camera.fy * p.y() * inverse_z + camera.cy - matches[i].pixel.y());
      Eigen::Matrix<double, 2, 3> projection;
      projection << camera.fx * inverse_z, 0, -camera.fx * p.x() * inverse_z * inverse_z, 0, camera.fy * inverse_z,
          -camera.fy * p.y() * inverse_z * inverse_z;
      Eigen::Matrix<double, 2, 6> jacobian;
      jacobian.leftCols<3>() = projection;
      jacobian.rightCols<3>() = -projection * Cross(p);
      const double weight = 1.0 / (1.0 + residual.squaredNorm() / (scale_px * scale_px));
      hessian.noalias() += weight * jacobian.transpose() * jacobian;
      gradient.noalias() += weight * jacobian.transpose() * residual;
      ++used;
    }
    if (used < 3) return T_camera_object;
    hessian.diagonal() *= 1.0 + 1e-6;
    const Vector6d delta = -hessian.ldlt().solve(gradient);
    if (!delta.allFinite()) return T_camera_object;
    T = Perturbed(T, delta);
    if (delta.norm() < 1e-8) break;
  }
  return T;
}

}  // namespace vantage::pose
