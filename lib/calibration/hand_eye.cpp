#include "calibration/hand_eye.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/calib3d.hpp>
#include <stdexcept>

#include "calibration/board_pose.h"

namespace vantage::calibration {
namespace {

constexpr double kLeastTurn_deg = 2.0, kEnoughTurn_deg = 15.0, kEnoughViews = 8;

struct Used {
  const HandEyeView* view;
  geometry::Rigid T_camera_board;
};

cv::Mat Rotation(const geometry::Rigid& T) {
  cv::Mat R(3, 3, CV_64F);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) R.at<double>(i, j) = T.linear()(i, j);
  return R;
}

cv::Mat Translation(const geometry::Rigid& T) {
  return (cv::Mat_<double>(3, 1) << T.translation().x(), T.translation().y(), T.translation().z());
}

geometry::Rigid Start(const std::vector<Used>& used) {
  std::vector<cv::Mat> mount_R, mount_t, board_R, board_t;
  for (const Used& one : used) {
    mount_R.push_back(Rotation(one.view->T_world_mount));
    mount_t.push_back(Translation(one.view->T_world_mount));
    board_R.push_back(Rotation(one.T_camera_board));
    board_t.push_back(Translation(one.T_camera_board));
  }
  cv::Mat R, t;
  cv::calibrateHandEye(mount_R, mount_t, board_R, board_t, R, t, cv::CALIB_HAND_EYE_PARK);
  geometry::Rigid T = geometry::Rigid::Identity();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) T.linear()(i, j) = R.at<double>(i, j);
    T.translation()(i) = t.at<double>(i);
  }
  return T;
}

// Turns of the mount against the first view, as rotation vectors: how much about the second most used axis, degrees.
double SecondTurn_deg(const std::vector<Used>& used) {
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Used& one : used) {
    const Eigen::AngleAxisd turn(used.front().view->T_world_mount.linear().transpose() * one.view->T_world_mount.linear());
    const Eigen::Vector3d vector = turn.angle() * turn.axis();
    spread += vector * vector.transpose() / static_cast<double>(used.size());
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(spread);
  return std::sqrt(std::max(0.0, solver.eigenvalues()(1))) * 180.0 / M_PI;
}

// A pose as a rotation vector and a translation.
struct PoseVector {
  double numbers[6];

  explicit PoseVector(const geometry::Rigid& T) {
    const Eigen::AngleAxisd turn(T.linear());
    const Eigen::Vector3d vector = turn.angle() * turn.axis();
    for (int i = 0; i < 3; ++i) {
      numbers[i] = vector(i);
      numbers[3 + i] = T.translation()(i);
    }
  }
  geometry::Rigid Rigid() const {
    geometry::Rigid T = geometry::Rigid::Identity();
    const Eigen::Vector3d vector(numbers[0], numbers[1], numbers[2]);
    if (vector.norm() > 0.0) T.linear() = Eigen::AngleAxisd(vector.norm(), vector.normalized()).toRotationMatrix();
    T.translation() = Eigen::Vector3d(numbers[3], numbers[4], numbers[5]);
    return T;
  }
};

// Where a board point ought to be seen, less where it is: x_camera = T_mount_camera^-1 D T_world_mount^-1 T_world_board x_board,
// where D is how far off the mount is in what it says.
struct PixelError {
  const rgbd::CameraCalibration& calibration;
  geometry::Rigid T_mount_world;
  Eigen::Vector3d point_in_board;
  Eigen::Vector2d pixel;
  double sigma_px;

  template <typename T>
  bool operator()(const T* mount_camera, const T* world_board, const T* mount_error, T* residual) const {
    const T in_board[3] = {T(point_in_board.x()), T(point_in_board.y()), T(point_in_board.z())};
    T world[3], told[3], mount[3], camera[3];
    ceres::AngleAxisRotatePoint(world_board, in_board, world);
    for (int i = 0; i < 3; ++i) world[i] += world_board[3 + i];
    for (int i = 0; i < 3; ++i) {
      told[i] = T(T_mount_world.translation()(i));
      for (int j = 0; j < 3; ++j) told[i] += T_mount_world.linear()(i, j) * world[j];
    }
    ceres::AngleAxisRotatePoint(mount_error, told, mount);
    for (int i = 0; i < 3; ++i) mount[i] += mount_error[3 + i] - mount_camera[3 + i];
    const T back[3] = {-mount_camera[0], -mount_camera[1], -mount_camera[2]};
    ceres::AngleAxisRotatePoint(back, mount, camera);
    if (camera[2] < T(1e-3)) return false;
    const T x = camera[0] / camera[2], y = camera[1] / camera[2];
    const auto& k = calibration.distortion;
    const T r2 = x * x + y * y;
    const T radial = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
    const T u = x * radial + 2.0 * k[2] * x * y + k[3] * (r2 + 2.0 * x * x);
    const T v = y * radial + k[2] * (r2 + 2.0 * y * y) + 2.0 * k[3] * x * y;
    residual[0] = (calibration.camera.fx * u + calibration.camera.cx - pixel.x()) / sigma_px;
    residual[1] = (calibration.camera.fy * v + calibration.camera.cy - pixel.y()) / sigma_px;
    return true;
  }
};

// The mount is believed to be where it says within its own errors.
struct MountError {
  double sigma_rad, sigma_m;

  template <typename T>
  bool operator()(const T* mount_error, T* residual) const {
    for (int i = 0; i < 3; ++i) {
      residual[i] = mount_error[i] / sigma_rad;
      residual[3 + i] = mount_error[3 + i] / sigma_m;
    }
    return true;
  }
};

// Of all points, with the mount where it says it is.
double Rms_px(const std::vector<Used>& used, const rgbd::CameraCalibration& calibration, const HandEyeResult& result) {
  double sum = 0.0;
  std::size_t points = 0;
  for (const Used& one : used) {
    const geometry::Rigid T_camera_board = (one.view->T_world_mount * result.T_mount_camera).inverse() * result.T_world_board;
    for (std::size_t i = 0; i < one.view->board.points_m.size(); ++i, ++points) {
      sum +=
          (ProjectDistorted(calibration, T_camera_board * one.view->board.points_m[i]) - one.view->board.pixels[i]).squaredNorm();
    }
  }
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, points)));
}

void Refine(const std::vector<Used>& used, const rgbd::CameraCalibration& calibration, const HandEyeParams& params,
            HandEyeResult& result) {
  PoseVector mount_camera(result.T_mount_camera), world_board(result.T_world_board);
  std::vector<PoseVector> errors(used.size(), PoseVector(geometry::Rigid::Identity()));
  ceres::Problem problem;
  for (std::size_t view = 0; view < used.size(); ++view) {
    const HandEyeView& seen = *used[view].view;
    const geometry::Rigid T_mount_world = seen.T_world_mount.inverse();
    for (std::size_t i = 0; i < seen.board.points_m.size(); ++i) {
      auto* error = new PixelError{calibration, T_mount_world, seen.board.points_m[i], seen.board.pixels[i], params.pixel_sigma};
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PixelError, 2, 6, 6, 6>(error), new ceres::HuberLoss(3.0),
                               mount_camera.numbers, world_board.numbers, errors[view].numbers);
    }
    auto* mount = new MountError{params.mount_sigma_deg * M_PI / 180.0, params.mount_sigma_m};
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<MountError, 6, 6>(mount), nullptr, errors[view].numbers);
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.max_num_iterations = 100;
  options.num_threads = 1;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (!summary.IsSolutionUsable()) throw std::runtime_error("hand-eye calibration does not converge: " + summary.message);
  result.T_mount_camera = mount_camera.Rigid();
  result.T_world_board = world_board.Rigid();
  result.rms_px = Rms_px(used, calibration, result);
}

void Judge(const std::vector<Used>& used, HandEyeResult& result) {
  double position = 0.0, rotation = 0.0;
  for (const Used& one : used) {
    const auto T_world_board = one.view->T_world_mount * result.T_mount_camera * one.T_camera_board;
    const auto difference = geometry::Difference(T_world_board, result.T_world_board);
    position += std::pow(1e3 * difference.translation_m, 2) / static_cast<double>(used.size());
    rotation += std::pow(difference.rotation_rad * 180.0 / M_PI, 2) / static_cast<double>(used.size());
  }
  result.position_mm = std::sqrt(position);
  result.rotation_deg = std::sqrt(rotation);
  char text[200];
  if (result.views < kEnoughViews) {
    std::snprintf(text, sizeof text, "only %d views count: take %.0f at least", result.views, kEnoughViews);
    result.warnings.emplace_back(text);
  }
  if (result.turn_deg < kEnoughTurn_deg) {
    std::snprintf(text, sizeof text,
                  "about its second axis the mount turned by %.0f degrees only: turn it more, about two axes at least",
                  result.turn_deg);
    result.warnings.emplace_back(text);
  }
}

}  // namespace

void HandEyeParams::Check() const {
  if (!(mount_sigma_m > 0.0)) throw std::invalid_argument("mount_sigma_m must be > 0");
  if (!(mount_sigma_deg > 0.0)) throw std::invalid_argument("mount_sigma_deg must be > 0");
  if (!(pixel_sigma > 0.0)) throw std::invalid_argument("pixel_sigma must be > 0");
}

HandEyeResult CalibrateHandEye(const std::vector<HandEyeView>& views, const rgbd::CameraCalibration& calibration,
                               const HandEyeParams& params) {
  params.Check();
  calibration.Check();
  std::vector<Used> used;
  for (const HandEyeView& view : views) {
    if (const auto pose = EstimateBoardPose(view.board, calibration)) used.push_back({&view, pose->T_camera_board});
  }
  if (used.size() < 3) {
    throw std::runtime_error("the board's pose is known in " + std::to_string(used.size()) + " of " + std::to_string(views.size()) +
                             " views; 3 are needed, 8 are good");
  }
  HandEyeResult result;
  result.views = static_cast<int>(used.size());
  result.turn_deg = SecondTurn_deg(used);
  if (result.turn_deg < kLeastTurn_deg) {
    throw std::runtime_error("the mount turned about one axis only, or not at all; turn it about two different ones");
  }
  result.T_mount_camera = Start(used);
  result.T_world_board = used.front().view->T_world_mount * result.T_mount_camera * used.front().T_camera_board;
  Refine(used, calibration, params, result);
  Judge(used, result);
  return result;
}

}  // namespace vantage::calibration
