#include "calibration/intrinsics.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <set>
#include <stdexcept>

#include "calibration/board_pose.h"

namespace vantage::calibration {
namespace {

constexpr int kCellsAcross = 8, kCellsDown = 6;
constexpr double kEnoughCoverage = 0.7, kEnoughTilt_deg = 20.0, kLargeError_px = 1.0;
constexpr std::size_t kEnoughViews = 10;
constexpr double kErrorScale = 20.0;

int Flags(int distortion_terms) {
  int flags = 0;
  if (distortion_terms < 5) flags |= cv::CALIB_FIX_K3;
  if (distortion_terms < 4) flags |= cv::CALIB_ZERO_TANGENT_DIST;
  if (distortion_terms < 2) flags |= cv::CALIB_FIX_K1 | cv::CALIB_FIX_K2;
  return flags;
}

std::set<int> CellsSeen(const std::vector<BoardView>& views, const std::vector<int>& used, const geometry::PinholeCamera& camera) {
  std::set<int> cells;
  for (const int index : used) {
    for (const auto& pixel : views[static_cast<std::size_t>(index)].pixels) {
      const int column = std::clamp(static_cast<int>(pixel.x() * kCellsAcross / camera.width), 0, kCellsAcross - 1);
      const int row = std::clamp(static_cast<int>(pixel.y() * kCellsDown / camera.height), 0, kCellsDown - 1);
      cells.insert(row * kCellsAcross + column);
    }
  }
  return cells;
}

void Solve(const std::vector<BoardView>& views, cv::Size size, const IntrinsicsParams& params, IntrinsicsResult& result) {
  std::vector<std::vector<cv::Point3f>> points;
  std::vector<std::vector<cv::Point2f>> pixels;
  for (const int index : result.used) {
    const BoardView& view = views[static_cast<std::size_t>(index)];
    points.emplace_back();
    pixels.emplace_back();
    for (std::size_t i = 0; i < view.points_m.size(); ++i) {
      points.back().emplace_back(static_cast<float>(view.points_m[i].x()), static_cast<float>(view.points_m[i].y()), 0.0F);
      pixels.back().emplace_back(static_cast<float>(view.pixels[i].x()), static_cast<float>(view.pixels[i].y()));
    }
  }
  cv::Mat K, k = cv::Mat::zeros(1, 5, CV_64F), intrinsic_sigmas, extrinsic_sigmas, errors;
  std::vector<cv::Mat> rotations, translations;
  result.rms_px = cv::calibrateCamera(points, pixels, size, K, k, rotations, translations, intrinsic_sigmas, extrinsic_sigmas,
                                      errors, Flags(params.distortion_terms));
  result.calibration.camera = {size.width,         size.height,        K.at<double>(0, 0),
                               K.at<double>(1, 1), K.at<double>(0, 2), K.at<double>(1, 2)};
  for (int i = 0; i < 5; ++i) result.calibration.distortion[static_cast<std::size_t>(i)] = k.at<double>(i);
  result.focal_sigma_px = intrinsic_sigmas.at<double>(0);
  result.centre_sigma_px = std::max(intrinsic_sigmas.at<double>(2), intrinsic_sigmas.at<double>(3));
  result.view_rms_px.assign(errors.begin<double>(), errors.end<double>());
  result.T_camera_board.clear();
  for (std::size_t i = 0; i < rotations.size(); ++i) {
    cv::Mat R;
    cv::Rodrigues(rotations[i], R);
    geometry::Rigid T = geometry::Rigid::Identity();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) T.linear()(row, column) = R.at<double>(row, column);
      T.translation()(row) = translations[i].at<double>(row);
    }
    result.T_camera_board.push_back(T);
  }
}

// Takes out views that fit much worse than the others; false where there are none.
bool DropBad(IntrinsicsResult& result, double max_ratio) {
  std::vector<double> sorted = result.view_rms_px;
  std::sort(sorted.begin(), sorted.end());
  const double limit_px = max_ratio * sorted[sorted.size() / 2];
  std::vector<int> kept;
  for (std::size_t i = 0; i < result.used.size(); ++i) {
    if (result.view_rms_px[i] <= limit_px) kept.push_back(result.used[i]);
  }
  if (kept.size() == result.used.size() || kept.size() < 3) return false;
  result.used = kept;
  return true;
}

void Judge(IntrinsicsResult& result) {
  for (const auto& T : result.T_camera_board) {
    const double cosine = std::min(1.0, std::abs(T.linear()(2, 2)));
    result.max_tilt_deg = std::max(result.max_tilt_deg, std::acos(cosine) * 180.0 / M_PI);
  }
  char text[200];
  if (result.used.size() < kEnoughViews) {
    std::snprintf(text, sizeof text, "only %zu views count: show the board in %zu at least", result.used.size(), kEnoughViews);
    result.warnings.emplace_back(text);
  }
  if (result.coverage < kEnoughCoverage) {
    std::snprintf(text, sizeof text, "the board was seen in %.0f %% of the image only: hold it to the borders and corners as well",
                  100.0 * result.coverage);
    result.warnings.emplace_back(text);
  }
  if (result.max_tilt_deg < kEnoughTilt_deg) {
    std::snprintf(text, sizeof text,
                  "the board was never tilted by more than %.0f degrees: without, focal length and distance are one",
                  result.max_tilt_deg);
    result.warnings.emplace_back(text);
  }
  if (result.rms_px > kLargeError_px) {
    std::snprintf(text, sizeof text, "%.2f px are a large error: is the board flat, its size right, and the picture sharp?",
                  result.rms_px);
    result.warnings.emplace_back(text);
  }
}

}  // namespace

void IntrinsicsParams::Check() const {
  const int terms = distortion_terms;
  if (terms != 0 && terms != 2 && terms != 4 && terms != 5) throw std::invalid_argument("distortion_terms must be 0, 2, 4 or 5");
  if (min_points < 4) throw std::invalid_argument("min_points must be >= 4");
  if (!(max_ratio > 1.0)) throw std::invalid_argument("max_ratio must be > 1");
}

IntrinsicsResult CalibrateIntrinsics(const std::vector<BoardView>& views, cv::Size image_size, const IntrinsicsParams& params) {
  params.Check();
  IntrinsicsResult result;
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (static_cast<int>(views[i].points_m.size()) < params.min_points) continue;
    for (const auto& point : views[i].points_m) {
      if (std::abs(point.z()) > 1e-9) throw std::runtime_error("a camera is calibrated with a planar board; this one is not");
    }
    result.used.push_back(static_cast<int>(i));
  }
  if (result.used.size() < 3) {
    throw std::runtime_error("the board was found in " + std::to_string(result.used.size()) + " of " +
                             std::to_string(views.size()) + " images; 3 are needed, " + std::to_string(kEnoughViews) + " are good");
  }
  do {
    Solve(views, image_size, params, result);
  } while (DropBad(result, params.max_ratio));
  result.coverage =
      static_cast<double>(CellsSeen(views, result.used, result.calibration.camera).size()) / (kCellsAcross * kCellsDown);
  Judge(result);
  return result;
}

cv::Mat DrawCoverage(const std::vector<BoardView>& views, const IntrinsicsResult& result) {
  const auto& camera = result.calibration.camera;
  cv::Mat picture(camera.height, camera.width, CV_8UC3, cv::Scalar(70, 70, 70));
  for (const int cell : CellsSeen(views, result.used, camera)) {
    const int column = cell % kCellsAcross, row = cell / kCellsAcross;
    const cv::Point from(column * camera.width / kCellsAcross, row * camera.height / kCellsDown);
    const cv::Point to((column + 1) * camera.width / kCellsAcross - 1, (row + 1) * camera.height / kCellsDown - 1);
    cv::rectangle(picture, from, to, cv::Scalar(245, 245, 245), cv::FILLED);
    cv::rectangle(picture, from, to, cv::Scalar(200, 200, 200), 1);
  }
  for (std::size_t i = 0; i < result.used.size(); ++i) {
    const BoardView& view = views[static_cast<std::size_t>(result.used[i])];
    for (std::size_t p = 0; p < view.pixels.size(); ++p) {
      const Eigen::Vector2d seen = view.pixels[p];
      const Eigen::Vector2d error = seen - ProjectDistorted(result.calibration, result.T_camera_board[i] * view.points_m[p]);
      const Eigen::Vector2d end = seen + kErrorScale * error;
      const cv::Point at(cvRound(seen.x()), cvRound(seen.y()));
      cv::circle(picture, at, 2, cv::Scalar(160, 90, 20), cv::FILLED, cv::LINE_AA);
      cv::line(picture, at, {cvRound(end.x()), cvRound(end.y())}, cv::Scalar(30, 30, 200), 1, cv::LINE_AA);
    }
  }
  char text[120];
  std::snprintf(text, sizeof text, "%zu views, %.2f px, %.0f %% covered; errors x %.0f", result.used.size(), result.rms_px,
                100.0 * result.coverage, kErrorScale);
  cv::putText(picture, text, {10, camera.height - 12}, cv::FONT_HERSHEY_SIMPLEX, 0.6, cv::Scalar(255, 255, 255), 4, cv::LINE_AA);
  cv::putText(picture, text, {10, camera.height - 12}, cv::FONT_HERSHEY_SIMPLEX, 0.6, cv::Scalar(0, 0, 0), 1, cv::LINE_AA);
  return picture;
}

}  // namespace vantage::calibration
