#include "pose/refine.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "pose/depth_noise.h"

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

// Sums of a weighted least-squares problem in the six degrees of freedom of a pose.
struct NormalEquations {
  Matrix6d hessian = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
  int matches = 0;
  int samples = 0;

  void Add(const Vector6d& jacobian, double residual, double weight) {
    hessian.noalias() += weight * jacobian * jacobian.transpose();
    gradient.noalias() += weight * residual * jacobian;
  }
};

double Cauchy(double squared, double scale) { return 1.0 / (1.0 + squared / (scale * scale)); }

// A pixel of reprojection error weighs as much as a standard deviation of depth.
void AddMatch(const Match2d3d& match, const geometry::PinholeCamera& camera, const geometry::Rigid& T, double scale_px,
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

// Point to plane against the depth image. Neighbouring depths err together, so that a sample weighs less than a match.
void AddSurface(const SurfacePoint& sample, const rgbd::Frame& frame, const geometry::Rigid& T, NormalEquations* equations) {
  constexpr double kMaxDistance = 0.02;
  constexpr double kSampleWeight = 1.0;
  const Eigen::Vector3d p = T * sample.point;
  const Eigen::Vector3d normal = T.linear() * sample.normal;
  if (normal.dot(p.normalized()) > -0.2) return;  // Seen at a grazing angle or from behind.
  const auto pixel = frame.camera.Project(p);
  if (!pixel || !frame.camera.Contains(*pixel)) return;
  // A whole pixel: half a pixel beside it, its depth would be off a slanted surface.
  const auto measured = rgbd::PointAt(frame, pixel->array().round(), 1);
  if (!measured) return;
  const double distance = normal.dot(p - *measured);
  if (std::abs(distance) > kMaxDistance) return;
  const double inverse_sigma = 1.0 / DepthNoise{}.Sigma(measured->z());
  Vector6d jacobian;
  jacobian << normal, p.cross(normal);
  const double error = distance * inverse_sigma;
  equations->Add(jacobian * inverse_sigma, error, kSampleWeight * Cauchy(error * error, 2.0));
  ++equations->samples;
}

void AddPrior(const PosePrior& prior, const geometry::Rigid& T, NormalEquations* equations) {
  const Eigen::Vector3d translation = T.translation() - prior.T_camera_object.translation();
  const Eigen::AngleAxisd turn(T.linear() * prior.T_camera_object.linear().transpose());
  const Eigen::Vector3d rotation = turn.angle() * turn.axis();
  const Eigen::Matrix3d lever = -Cross(T.translation());
  for (int axis = 0; axis < 3; ++axis) {
    Vector6d jacobian = Vector6d::Zero();
    jacobian(axis) = 1.0;
    jacobian.tail<3>() = lever.row(axis).transpose();
    equations->Add(jacobian / prior.sigma_m, translation(axis) / prior.sigma_m, 1.0);
    jacobian.setZero();
    jacobian(3 + axis) = 1.0;
    equations->Add(jacobian / prior.sigma_rad, rotation(axis) / prior.sigma_rad, 1.0);
  }
}

// `add` puts all residuals at a pose into the equations.
template <typename AddAll>
geometry::Rigid GaussNewton(const geometry::Rigid& start, int iterations, const AddAll& add) {
  geometry::Rigid T = start;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    NormalEquations equations;
    add(T, &equations);
    if (equations.matches < 3) return start;
    equations.hessian.diagonal() *= 1.0 + 1e-6;
    const Vector6d delta = -equations.hessian.ldlt().solve(equations.gradient);
    if (!delta.allFinite()) return start;
    T = Perturbed(T, delta);
    if (delta.norm() < 1e-8) break;
  }
  return T;
}

}  // namespace

double ReprojectionError(const Match2d3d& match, const geometry::PinholeCamera& camera, const geometry::Rigid& T_camera_object) {
  const auto pixel = camera.Project(T_camera_object * match.point);
  return pixel ? (*pixel - match.pixel).norm() : std::numeric_limits<double>::infinity();
}

geometry::Rigid RefinePose(const std::vector<Match2d3d>& matches, const std::vector<int>& index,
                           const geometry::PinholeCamera& camera, const geometry::Rigid& T_camera_object, double scale_px,
                           int iterations) {
  return GaussNewton(T_camera_object, iterations, [&](const geometry::Rigid& T, NormalEquations* equations) {
    for (const int i : index) AddMatch(matches[i], camera, T, scale_px, equations);
  });
}

PoseSpread SpreadOfPose(const std::vector<Match2d3d>& matches, const std::vector<int>& index, const geometry::PinholeCamera& camera,
                        const geometry::Rigid& T_camera_object, double pixel_sigma) {
  constexpr double kEveryMatchCounts = 1e6;  // A Cauchy scale, in pixels, at which none is played down.
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  NormalEquations equations;
  for (const int i : index) {
    AddMatch(matches[i], camera, T_camera_object, kEveryMatchCounts, &equations);
  }
  if (equations.matches < 3) return {kInfinite, kInfinite};
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(equations.hessian);
  if (!(solver.eigenvalues()(0) > 1e-9 * solver.eigenvalues()(5))) return {kInfinite, kInfinite};
  const Matrix6d covariance = pixel_sigma * pixel_sigma * equations.hessian.inverse();
  Eigen::Matrix<double, 3, 6> of_origin;  // How the object's origin moves with a pose's six freedoms.
  of_origin << Eigen::Matrix3d::Identity(), -Cross(T_camera_object.translation());
  const auto worst = [](const Eigen::Matrix3d& m) {
    return std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(m).eigenvalues()(2)));
  };
  return {worst(of_origin * covariance * of_origin.transpose()), worst(covariance.bottomRightCorner<3, 3>())};
}

geometry::Rigid RefinePoseOnSurface(const std::vector<Match2d3d>& matches, const std::vector<int>& index,
                                    const std::vector<SurfacePoint>& surface, const rgbd::Frame& frame,
                                    const std::optional<PosePrior>& prior, const geometry::Rigid& T_camera_object, double scale_px,
                                    int iterations) {
  // Matches err together (their model points were lifted from few depth images), and beside a prior that counts: they weigh at most
  // as much as so many independent ones.
  constexpr double kIndependentMatches = 8.0;
  const double weight = prior ? std::min(1.0, kIndependentMatches / std::max<double>(1.0, index.size())) : 1.0;
  return GaussNewton(T_camera_object, iterations, [&](const geometry::Rigid& T, NormalEquations* equations) {
    for (const int i : index) AddMatch(matches[i], frame.camera, T, scale_px, equations);
    equations->hessian *= weight;
    equations->gradient *= weight;
    for (const SurfacePoint& sample : surface) AddSurface(sample, frame, T, equations);
    if (prior) AddPrior(*prior, T, equations);
  });
}

SurfaceFit FitSurface(const std::vector<SurfacePoint>& surface, const rgbd::Frame& frame, const geometry::Rigid& T_camera_object,
                      double independent, int iterations) {
  SurfaceFit fit;
  fit.T_camera_object = T_camera_object;
  for (int iteration = 0;; ++iteration) {
    NormalEquations equations;
    for (const SurfacePoint& sample : surface) AddSurface(sample, frame, fit.T_camera_object, &equations);
    fit.samples = equations.samples;
    fit.information = equations.hessian * std::min(1.0, independent / std::max(1, equations.samples));
    if (iteration == iterations || equations.samples < 6) return fit;
    // Directions in which the surface slides are held by a weight that is little beside any that it does not slide in.
    const double held = 1e-3 * equations.hessian.topLeftCorner<3, 3>().trace();
    equations.hessian.diagonal().head<3>().array() += held;
    equations.hessian.diagonal().tail<3>().array() += held * fit.T_camera_object.translation().squaredNorm();
    const Vector6d delta = -equations.hessian.ldlt().solve(equations.gradient);
    if (!delta.allFinite()) return fit;
    fit.T_camera_object = Perturbed(fit.T_camera_object, delta);
  }
}

}  // namespace vantage::pose
