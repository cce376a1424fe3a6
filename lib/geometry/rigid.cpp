#include "geometry/rigid.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace vantage::geometry {

double RotationAngle(const Eigen::Matrix3d& rotation) {
  return 2.0 * std::atan2(Eigen::Quaterniond(rotation).vec().norm(), std::abs(Eigen::Quaterniond(rotation).w()));
}

double AngleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

PoseDifference Difference(const Rigid& a, const Rigid& b) {
  return {(a.translation() - b.translation()).norm(), RotationAngle(a.linear().transpose() * b.linear())};
}

Rigid LookAt(const Eigen::Vector3d& eye, const Eigen::Vector3d& target, const Eigen::Vector3d& up, double roll_rad) {
  const Eigen::Vector3d sight = target - eye;
  if (sight.norm() < 1e-9) throw std::invalid_argument("LookAt: eye and target must differ");
  const Eigen::Vector3d z = sight.normalized();
  Eigen::Vector3d x = z.cross(up);
  if (x.norm() < 1e-6 * up.norm()) x = z.cross(Eigen::Vector3d::UnitX());
  if (x.norm() < 1e-6) x = z.cross(Eigen::Vector3d::UnitY());
  x.normalize();
  Rigid T = Rigid::Identity();
  T.linear().col(0) = x;
  T.linear().col(1) = z.cross(x);
  T.linear().col(2) = z;
  T.translation() = eye;
  T.rotate(Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitZ()));
  return T;
}

Rigid Interpolate(const Rigid& a, const Rigid& b, double t) {
  Rigid T = Rigid::Identity();
  T.linear() = Eigen::Quaterniond(a.linear()).slerp(t, Eigen::Quaterniond(b.linear())).toRotationMatrix();
  T.translation() = (1.0 - t) * a.translation() + t * b.translation();
  return T;
}

Eigen::Vector3d ViewDirection(const Rigid& T_camera_object) { return T_camera_object.inverse().translation().normalized(); }

}  // namespace vantage::geometry
