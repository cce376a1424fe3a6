#include "calibration/board_pose.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <set>

namespace vantage::calibration {
namespace {

constexpr int kRounds = 4;
constexpr double kLeastError_px = 3.0;
constexpr double kMedians = 4.0;

struct CvCamera {
  explicit CvCamera(const rgbd::CameraCalibration& calibration)
      : K(calibration.camera.fx, 0, calibration.camera.cx, 0, calibration.camera.fy, calibration.camera.cy, 0, 0, 1),
        k(1, 5, CV_64F) {
    for (int i = 0; i < 5; ++i) k.at<double>(i) = calibration.distortion[static_cast<std::size_t>(i)];
  }
  cv::Matx33d K;
  cv::Mat k;
};

struct CvPoints {
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> pixels;
};

geometry::Rigid FromCv(const cv::Mat& rotation, const cv::Mat& translation) {
  cv::Mat R;
  cv::Rodrigues(rotation, R);
  geometry::Rigid T = geometry::Rigid::Identity();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) T.linear()(i, j) = R.at<double>(i, j);
    T.translation()(i) = translation.at<double>(i);
  }
  return T;
}

std::vector<double> Errors(const CvPoints& p, const CvCamera& camera, const cv::Mat& rotation, const cv::Mat& translation) {
  std::vector<cv::Point2d> projected;
  cv::projectPoints(p.points, rotation, translation, camera.K, camera.k, projected);
  std::vector<double> errors;
  for (std::size_t i = 0; i < projected.size(); ++i) errors.push_back(cv::norm(projected[i] - p.pixels[i]));
  return errors;
}

double Rms(const std::vector<double>& errors) {
  double sum = 0.0;
  for (const double error : errors) sum += error * error;
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, errors.size())));
}

struct Solution {
  cv::Mat rotation, translation;
  double rms_px = 1e300;
};

std::optional<Solution> Solve(const CvPoints& p, const CvCamera& camera) {
  const bool planar = std::all_of(p.points.begin(), p.points.end(), [](const cv::Point3d& q) { return std::abs(q.z) < 1e-9; });
  std::vector<cv::Mat> rotations, translations;
  try {
    cv::solvePnPGeneric(p.points, p.pixels, camera.K, camera.k, rotations, translations, false,
                        planar ? cv::SOLVEPNP_IPPE : cv::SOLVEPNP_SQPNP);
  } catch (const cv::Exception&) {  // Degenerate: all in one line.
    return std::nullopt;
  }
  std::optional<Solution> best;
  for (std::size_t i = 0; i < rotations.size(); ++i) {
    cv::solvePnPRefineLM(p.points, p.pixels, camera.K, camera.k, rotations[i], translations[i]);
    const double rms_px = Rms(Errors(p, camera, rotations[i], translations[i]));
    if (!std::isfinite(rms_px) || translations[i].at<double>(2) <= 0.0) continue;
    if (!best || rms_px < best->rms_px) best = Solution{rotations[i], translations[i], rms_px};
  }
  return best;
}

CvPoints Without(const BoardView& view, const std::set<int>& left_out) {
  CvPoints p;
  for (std::size_t i = 0; i < view.points_m.size(); ++i) {
    if (left_out.count(view.parts[i])) continue;
    p.points.emplace_back(view.points_m[i].x(), view.points_m[i].y(), view.points_m[i].z());
    p.pixels.emplace_back(view.pixels[i].x(), view.pixels[i].y());
  }
  return p;
}

}  // namespace

std::optional<BoardPose> EstimateBoardPose(const BoardView& view, const rgbd::CameraCalibration& calibration) {
  const CvCamera camera(calibration);
  std::set<int> left_out;
  std::optional<Solution> solution;
  std::size_t used = 0;
  for (int round = 0; round < kRounds; ++round) {
    const CvPoints p = Without(view, left_out);
    if (p.points.size() < 4) return std::nullopt;
    solution = Solve(p, camera);
    if (!solution) return std::nullopt;
    used = p.points.size();
    std::vector<double> errors = Errors(p, camera, solution->rotation, solution->translation);
    std::nth_element(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2), errors.end());
    const double limit_px = std::max(kLeastError_px, kMedians * errors[errors.size() / 2]);
    const std::vector<double> all = Errors(Without(view, {}), camera, solution->rotation, solution->translation);
    std::set<int> off;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (all[i] > limit_px) off.insert(view.parts[i]);
    }
    if (off == left_out || off.count(0)) break;  // Of a checkerboard all points are one part.
    left_out = off;
  }
  BoardPose pose;
  pose.T_camera_board = FromCv(solution->rotation, solution->translation);
  pose.rms_px = solution->rms_px;
  pose.points = static_cast<int>(used);
  pose.dropped = static_cast<int>(view.points_m.size() - used);
  return pose;
}

Eigen::Vector2d ProjectDistorted(const rgbd::CameraCalibration& calibration, const Eigen::Vector3d& point_in_camera) {
  const CvCamera camera(calibration);
  std::vector<cv::Point2d> projected;
  const std::vector<cv::Point3d> points{{point_in_camera.x(), point_in_camera.y(), point_in_camera.z()}};
  cv::projectPoints(points, cv::Vec3d(), cv::Vec3d(), camera.K, camera.k, projected);
  return {projected[0].x, projected[0].y};
}

}  // namespace vantage::calibration
