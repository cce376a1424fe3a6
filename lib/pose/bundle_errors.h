// The errors that bundle adjustment sums, as Ceres cost functions. Internal to pose.
#pragma once

#include <ceres/ceres.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "pose/bundle.h"
#include "pose/normal_equations.h"

namespace vantage::pose {

constexpr double kMinDepth = 1e-3;     // Nearer points are behind the camera.
constexpr double kBehindSigmas = 1e3;  // The error of a point behind the camera: flat, so that nothing pulls on it.

using PoseBlock = std::array<double, 7>;  // Quaternion x y z w, translation: of T_camera_object.

inline PoseBlock BlockOf(const geometry::Rigid& T) {
  const Eigen::Quaterniond q(T.linear());
  return {q.x(), q.y(), q.z(), q.w(), T.translation().x(), T.translation().y(), T.translation().z()};
}

inline geometry::Rigid RigidOf(const PoseBlock& block) {
  geometry::Rigid T = geometry::Rigid::Identity();
  T.linear() = Eigen::Map<const Eigen::Quaterniond>(block.data()).normalized().toRotationMatrix();
  T.translation() = Eigen::Map<const Eigen::Vector3d>(block.data() + 4);
  return T;
}

// Steps (translation, rotation vector) in camera coordinates: t + v, exp(w) R. The cost functions give their derivatives by the
// step directly, in the first six columns, so that the derivative of Plus is [I; 0].
class PoseManifold : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* result) const override {
    const Eigen::Map<const Eigen::Vector3d> rotation(delta + 3);
    const double angle = rotation.norm();
    Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
    if (angle > 1e-15) turn = Eigen::AngleAxisd(angle, rotation / angle);
    Eigen::Map<Eigen::Quaterniond> turned(result);
    turned = (turn * Eigen::Map<const Eigen::Quaterniond>(x)).normalized();
    for (int i = 0; i < 3; ++i) result[4 + i] = x[4 + i] + delta[i];
    return true;
  }
  bool PlusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 7, 6, Eigen::RowMajor>> identity(jacobian);
    identity.setIdentity();
    return true;
  }
  bool Minus(const double* y, const double* x, double* difference) const override {
    const Eigen::AngleAxisd turn(Eigen::Map<const Eigen::Quaterniond>(y) * Eigen::Map<const Eigen::Quaterniond>(x).conjugate());
    Eigen::Map<Eigen::Vector3d> rotation(difference + 3);
    rotation = turn.angle() * turn.axis();
    for (int i = 0; i < 3; ++i) difference[i] = y[4 + i] - x[4 + i];
    return true;
  }
  bool MinusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>> identity(jacobian);
    identity.setIdentity();
    return true;
  }
};

// A point seen by a camera: its rotated offset from the object's origin, and its camera coordinates.
struct Seen {
  Eigen::Matrix3d R;
  Eigen::Vector3d offset;
  Eigen::Vector3d p;

  Seen(const double* pose, const double* point)
      : R(Eigen::Map<const Eigen::Quaterniond>(pose).toRotationMatrix()),
        offset(R * Eigen::Map<const Eigen::Vector3d>(point)),
        p(offset + Eigen::Map<const Eigen::Vector3d>(pose + 4)) {}
  bool InFront() const { return p.z() > kMinDepth; }
};

// Fills the Jacobians of two residuals whose derivative by the camera coordinates is `by_p`.
inline void FillJacobians(const Seen& seen, const Eigen::Matrix<double, 2, 3>& by_p, double** jacobians) {
  if (!jacobians) return;
  if (jacobians[0]) {
    Eigen::Map<Eigen::Matrix<double, 2, 7, Eigen::RowMajor>> by_pose(jacobians[0]);
    by_pose.leftCols<3>() = by_p;
    by_pose.middleCols<3>(3).noalias() = -by_p * Cross(seen.offset);
    by_pose.col(6).setZero();
  }
  if (jacobians[1]) {
    Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>> by_point(jacobians[1]);
    by_point.noalias() = by_p * seen.R;
  }
}

class PixelError : public ceres::SizedCostFunction<2, 7, 3> {
 public:
  PixelError(const geometry::PinholeCamera& camera, const Eigen::Vector2d& pixel, double sigma)
      : camera_(camera), pixel_(pixel), inverse_sigma_(1.0 / sigma) {}
  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
    const Seen seen(parameters[0], parameters[1]);
    Eigen::Matrix<double, 2, 3> by_p = Eigen::Matrix<double, 2, 3>::Zero();
    if (seen.InFront()) {
      const double inverse_z = 1.0 / seen.p.z();
      const double x = seen.p.x() * inverse_z, y = seen.p.y() * inverse_z;
      residuals[0] = (camera_.fx * x + camera_.cx - pixel_.x()) * inverse_sigma_;
      residuals[1] = (camera_.fy * y + camera_.cy - pixel_.y()) * inverse_sigma_;
      by_p << camera_.fx, 0, -camera_.fx * x, 0, camera_.fy, -camera_.fy * y;
      by_p *= inverse_z * inverse_sigma_;
    } else {
      residuals[0] = residuals[1] = kBehindSigmas;
    }
    FillJacobians(seen, by_p, jacobians);
    return true;
  }

 private:
  geometry::PinholeCamera camera_;
  Eigen::Vector2d pixel_;
  double inverse_sigma_;
};

// Two residuals, the second always 0: where all have two, Ceres eliminates the points by its fixed-size code, three times as fast.
class DepthError : public ceres::SizedCostFunction<2, 7, 3> {
 public:
  DepthError(double depth_m, double sigma_m) : depth_m_(depth_m), inverse_sigma_(1.0 / sigma_m) {}
  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
    const Seen seen(parameters[0], parameters[1]);
    residuals[0] = (seen.p.z() - depth_m_) * inverse_sigma_;
    residuals[1] = 0.0;
    Eigen::Matrix<double, 2, 3> by_p = Eigen::Matrix<double, 2, 3>::Zero();
    by_p(0, 2) = inverse_sigma_;
    FillJacobians(seen, by_p, jacobians);
    return true;
  }

 private:
  double depth_m_;
  double inverse_sigma_;
};

class PriorError : public ceres::SizedCostFunction<6, 7> {
 public:
  explicit PriorError(const PosePrior& prior) : prior_(prior), pose_(BlockOf(prior.T_camera_object)) {}
  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
    PoseManifold().Minus(parameters[0], pose_.data(), residuals);
    for (int i = 0; i < 6; ++i) residuals[i] /= Sigma(i);
    if (!jacobians || !jacobians[0]) return true;
    Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>> jacobian(jacobians[0]);
    jacobian.setZero();
    for (int i = 0; i < 6; ++i) jacobian(i, i) = 1.0 / Sigma(i);  // To first order in the turn away from the prior.
    return true;
  }

 private:
  double Sigma(int i) const { return i < 3 ? prior_.sigma_m : prior_.sigma_rad; }
  PosePrior prior_;
  PoseBlock pose_;
};

// Two views' relative pose against a measured one, whitened. The error is the step (translation, rotation vector) in view b's
// coordinates from the measured T_b_a to the present one.
class RelationError : public ceres::SizedCostFunction<6, 7, 7> {
 public:
  explicit RelationError(const BundleRelation& relation) : T_b_a_(relation.T_b_a) {
    const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(relation.information);
    whitening_ = solver.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() * solver.eigenvectors().transpose();
  }
  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Matrix3d R_a = Eigen::Map<const Eigen::Quaterniond>(parameters[0]).toRotationMatrix();
    const Eigen::Matrix3d R_b = Eigen::Map<const Eigen::Quaterniond>(parameters[1]).toRotationMatrix();
    const Eigen::Map<const Eigen::Vector3d> t_a(parameters[0] + 4), t_b(parameters[1] + 4);
    const Eigen::Matrix3d R_b_a = R_b * R_a.transpose();
    const Eigen::AngleAxisd turn(R_b_a * T_b_a_.linear().transpose());
    const Eigen::Vector3d lever = R_b_a * (t_a + T_b_a_.linear().transpose() * T_b_a_.translation());
    Vector6d error;
    error << t_b - lever, turn.angle() * turn.axis();
    Eigen::Map<Vector6d> whitened(residuals);
    whitened.noalias() = whitening_ * error;
    if (!jacobians) return true;
    Matrix6d by_b = Matrix6d::Identity();  // To first order in the error's turn.
    by_b.topRightCorner<3, 3>() = Cross(lever);
    Matrix6d by_a = Matrix6d::Zero();
    by_a.topLeftCorner<3, 3>() = -R_b_a;
    by_a.topRightCorner<3, 3>() = -Cross(lever) * R_b_a;
    by_a.bottomRightCorner<3, 3>() = -R_b_a;
    Fill(by_a, jacobians[0]);
    Fill(by_b, jacobians[1]);
    return true;
  }

 private:
  void Fill(const Matrix6d& by_step, double* jacobian) const {
    if (!jacobian) return;
    Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>> by_pose(jacobian);
    by_pose.leftCols<6>().noalias() = whitening_ * by_step;
    by_pose.col(6).setZero();
  }

  geometry::Rigid T_b_a_;
  Matrix6d whitening_;
};

}  // namespace vantage::pose
