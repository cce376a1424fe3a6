#include "pose/refine.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "pose/normal_equations.h"

namespace vantage::pose {

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
                        const geometry::Rigid& T_camera_object, double pixel_sigma, const Matrix6d& other_information) {
  constexpr double kEveryMatchCounts = 1e6;  // A Cauchy scale, in pixels, at which none is played down.
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  NormalEquations equations;
  for (const int i : index) {
    AddMatch(matches[i], camera, T_camera_object, kEveryMatchCounts, &equations);
  }
  const Matrix6d information = equations.hessian / (pixel_sigma * pixel_sigma) + other_information;
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(information);
  if (!(solver.eigenvalues()(0) > 1e-9 * solver.eigenvalues()(5))) return {kInfinite, kInfinite};
  const Matrix6d covariance = information.inverse();
  Eigen::Matrix<double, 3, 6> of_origin;  // How the object's origin moves with a pose's six freedoms.
  of_origin << Eigen::Matrix3d::Identity(), -Cross(T_camera_object.translation());
  const auto worst = [](const Eigen::Matrix3d& m) {
    return std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(m).eigenvalues()(2)));
  };
  return {worst(of_origin * covariance * of_origin.transpose()), worst(covariance.bottomRightCorner<3, 3>())};
}

}  // namespace vantage::pose
