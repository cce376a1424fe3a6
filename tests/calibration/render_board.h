// Pictures of calibration boards as a distorting camera takes them.
#pragma once

#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "calibration/board.h"
#include "geometry/rigid.h"
#include "rgbd/calibration.h"

namespace vantage::testing {

inline constexpr double kPixelsPerMetre = 4000.0;
inline constexpr double kMargin_m = 0.04;  // White paper around what is printed.

// What is printed, pixel (u, v) being board point ((u, v) + 0.5) / kPixelsPerMetre - kMargin_m. Tags: those of TagGrid with 36h11.
inline cv::Mat PrintBoard(const calibration::Board& board) {
  double across = 0.0, down = 0.0;
  const bool checkerboard = board.kind == calibration::Board::Kind::kCheckerboard;
  if (checkerboard) {
    across = board.columns * board.square_m;
    down = board.rows * board.square_m;
  }
  for (const auto& [id, corners] : board.tags) {
    across = std::max(across, corners[2].x());
    down = std::max(down, corners[2].y());
  }
  const auto pixels = [](double metres) { return cvRound(metres * kPixelsPerMetre); };
  const double before = checkerboard ? board.square_m : 0.0;  // The first inner corner is one square inside.
  cv::Mat paper(pixels(down + before + 2 * kMargin_m), pixels(across + before + 2 * kMargin_m), CV_8UC1, cv::Scalar(235));
  if (checkerboard) {
    for (int row = -1; row < board.rows; ++row) {
      for (int column = -1; column < board.columns; ++column) {
        if ((row + column) % 2 != 0) continue;
        const int size = pixels(board.square_m);
        paper(cv::Rect(pixels(column * board.square_m + kMargin_m), pixels(row * board.square_m + kMargin_m), size, size)) = 20;
      }
    }
  }
  const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_APRILTAG_36h11);
  for (const auto& [id, corners] : board.tags) {
    const int size = pixels(corners[1].x() - corners[0].x());
    cv::Mat tag;
    cv::aruco::drawMarker(dictionary, id, 8 * 40, tag);
    cv::resize(tag, tag, {size, size}, 0, 0, cv::INTER_AREA);
    tag = tag * (215.0 / 255.0) + 20;
    tag.copyTo(paper(cv::Rect(pixels(corners[0].x() + kMargin_m), pixels(corners[0].y() + kMargin_m), size, size)));
  }
  return paper;
}

// BGR, in front of a grey wall, a little blurred and noisy (sigma 2 grey levels).
inline cv::Mat PhotographBoard(const cv::Mat& paper, const rgbd::CameraCalibration& lens, const geometry::Rigid& T_camera_board,
                               int seed) {
  constexpr int kSamples = 2;
  const auto& camera = lens.camera;
  const cv::Matx33d K(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
  const cv::Mat k(1, 5, CV_64F, const_cast<double*>(lens.distortion.data()));
  std::vector<cv::Point2d> pixels, rays;
  for (int v = 0; v < camera.height * kSamples; ++v) {
    for (int u = 0; u < camera.width * kSamples; ++u) pixels.emplace_back((u + 0.5) / kSamples - 0.5, (v + 0.5) / kSamples - 0.5);
  }
  cv::undistortPoints(pixels, rays, K, k);
  const geometry::Rigid T_board_camera = T_camera_board.inverse();
  const Eigen::Vector3d eye = T_board_camera.translation();
  cv::Mat map(camera.height * kSamples, camera.width * kSamples, CV_32FC2);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Eigen::Vector3d ray = T_board_camera.linear() * Eigen::Vector3d(rays[i].x, rays[i].y, 1.0);
    const Eigen::Vector3d point = eye - ray * (eye.z() / ray.z());
    map.at<cv::Vec2f>(static_cast<int>(i) / map.cols, static_cast<int>(i) % map.cols) =
        cv::Vec2f(static_cast<float>((point.x() + kMargin_m) * kPixelsPerMetre - 0.5),
                  static_cast<float>((point.y() + kMargin_m) * kPixelsPerMetre - 0.5));
  }
  cv::Mat large, image, noise(camera.height, camera.width, CV_16SC3);
  cv::remap(paper, large, map, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_CONSTANT, cv::Scalar(120));
  cv::resize(large, image, {camera.width, camera.height}, 0, 0, cv::INTER_AREA);
  cv::GaussianBlur(image, image, {0, 0}, 0.6);
  cv::cvtColor(image, image, cv::COLOR_GRAY2BGR);
  cv::RNG random(static_cast<std::uint64_t>(seed) + 1);
  random.fill(noise, cv::RNG::NORMAL, 0.0, 2.0);
  cv::add(image, noise, image, cv::noArray(), CV_8UC3);
  return image;
}

// Camera poses all round a board whose middle is `middle` (board frame), tilted and turned, near and far; the same for one number.
inline geometry::Rigid BoardPoseOf(int number, const Eigen::Vector3d& middle) {
  const double around = 2.4 * number, tilt = 0.15 + 0.12 * (number % 5), distance = 0.35 + 0.06 * (number % 4);
  // The board's z points into the paper: the camera is at negative z.
  const Eigen::Vector3d eye =
      middle + distance * Eigen::Vector3d(std::sin(tilt) * std::cos(around), std::sin(tilt) * std::sin(around), -std::cos(tilt));
  const Eigen::Vector3d target = middle + 0.08 * Eigen::Vector3d(std::cos(1.7 * number), std::sin(2.3 * number), 0.0);
  return geometry::LookAt(eye, target, Eigen::Vector3d(0, -1, 0), 0.4 * std::sin(1.1 * number)).inverse();
}

}  // namespace vantage::testing
