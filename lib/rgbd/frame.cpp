#include "rgbd/frame.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>

namespace vantage::rgbd {
namespace {

constexpr double kMetresPerUnit = 0.001;

std::string Size(const cv::Mat& image) { return std::to_string(image.cols) + "x" + std::to_string(image.rows); }

// Depth in metres of a pixel inside the image; 0 where there is none.
double MeasuredAt(const cv::Mat& depth, int x, int y) { return kMetresPerUnit * depth.at<std::uint16_t>(y, x); }

// Residuals of a plane fit above this mean that the window spans a depth edge: some three times the noise of a structured-light
// sensor, which grows with depth squared.
double EdgeResidual(double depth_m) { return 0.002 + 0.003 * depth_m * depth_m; }

}  // namespace

cv::Mat Gray(const Frame& frame) {
  cv::Mat gray;
  cv::cvtColor(frame.color, gray, cv::COLOR_BGR2GRAY);
  return gray;
}

std::optional<double> DepthAt(const Frame& frame, const Eigen::Vector2d& pixel, int radius_px) {
  if (frame.depth.empty() || !pixel.allFinite()) return std::nullopt;
  const cv::Mat& depth = frame.depth;
  if (pixel.cwiseAbs().maxCoeff() > 1e6) return std::nullopt;  // lround must not overflow.
  const int x = static_cast<int>(std::lround(pixel.x())), y = static_cast<int>(std::lround(pixel.y()));
  if (x < 0 || y < 0 || x >= depth.cols || y >= depth.rows) return std::nullopt;
  if (depth.at<std::uint16_t>(y, x) > 0) return MeasuredAt(depth, x, y);

  std::vector<double> around;
  for (int v = std::max(0, y - radius_px); v <= std::min(depth.rows - 1, y + radius_px); ++v) {
    for (int u = std::max(0, x - radius_px); u <= std::min(depth.cols - 1, x + radius_px); ++u) {
      const bool near = (u - x) * (u - x) + (v - y) * (v - y) <= radius_px * radius_px;
      if (near && depth.at<std::uint16_t>(v, u) > 0) around.push_back(MeasuredAt(depth, u, v));
    }
  }
  if (around.empty()) return std::nullopt;
  // The lower median: a measured depth, never one in the air between two surfaces.
  const auto middle = around.begin() + (around.size() - 1) / 2;
  std::nth_element(around.begin(), middle, around.end());
  return *middle;
}

std::optional<Eigen::Vector3d> PointAt(const Frame& frame, const Eigen::Vector2d& pixel, int radius_px) {
  const std::optional<double> depth_m = DepthAt(frame, pixel, radius_px);
  if (!depth_m) return std::nullopt;
  return frame.camera.Unproject(pixel, *depth_m);
}

std::optional<Eigen::Vector3d> NormalAt(const Frame& frame, const Eigen::Vector2d& pixel, int radius_px) {
  const std::optional<double> centre_m = DepthAt(frame, pixel);
  if (!centre_m || radius_px < 1) return std::nullopt;
  const int x = static_cast<int>(std::lround(pixel.x())), y = static_cast<int>(std::lround(pixel.y()));
  const int side = 2 * radius_px + 1;
  Eigen::Matrix3Xd rays(3, side * side);
  Eigen::VectorXd inverse_depths(side * side);
  int count = 0;
  for (int v = std::max(0, y - radius_px); v <= std::min(frame.depth.rows - 1, y + radius_px); ++v) {
    for (int u = std::max(0, x - radius_px); u <= std::min(frame.depth.cols - 1, x + radius_px); ++u) {
      const double depth_m = MeasuredAt(frame.depth, u, v);
      if (depth_m <= 0.0) continue;
      rays.col(count) = frame.camera.Unproject(Eigen::Vector2d(u, v), 1.0);
      inverse_depths(count++) = 1.0 / depth_m;
    }
  }
  if (2 * count < side * side) return std::nullopt;

  // On a plane 1/z is linear in the ray: n·(z·ray) = -d  =>  1/z = g·ray with g = -n/d. One 3x3 solve, no eigenvectors.
  const auto used = rays.leftCols(count);
  const Eigen::Matrix3d normal_matrix = used * used.transpose();
  const Eigen::Vector3d g = normal_matrix.ldlt().solve(used * inverse_depths.head(count));
  const double residual = std::sqrt((used.transpose() * g - inverse_depths.head(count)).squaredNorm() / count);
  const double residual_m = residual * *centre_m * *centre_m;
  if (!g.allFinite() || g.norm() < 1e-9 || residual_m > EdgeResidual(*centre_m)) return std::nullopt;
  return -g.normalized();  // g·(visible point) = 1 > 0, so -g faces the camera.
}

cv::Mat OrganisedCloud(const Frame& frame) {
  const cv::Mat& depth = frame.depth;
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  cv::Mat cloud(depth.size(), CV_32FC3);
  const geometry::PinholeCamera& camera = frame.camera;
  std::vector<float> ray_x(depth.cols);
  for (int x = 0; x < depth.cols; ++x) ray_x[x] = static_cast<float>((x - camera.cx) / camera.fx);
  for (int y = 0; y < depth.rows; ++y) {
    const std::uint16_t* row = depth.ptr<std::uint16_t>(y);
    cv::Vec3f* points = cloud.ptr<cv::Vec3f>(y);
    const float ray_y = static_cast<float>((y - camera.cy) / camera.fy);
    for (int x = 0; x < depth.cols; ++x) {
      const float z = row[x] > 0 ? static_cast<float>(kMetresPerUnit * row[x]) : kNan;
      points[x] = cv::Vec3f(ray_x[x] * z, ray_y * z, z);
    }
  }
  return cloud;
}

void CheckFrame(const Frame& frame) {
  const auto fail = [&](const std::string& what) {
    throw std::invalid_argument("frame " + std::to_string(frame.id) + ": " + what);
  };
  if (frame.color.empty()) fail("expected a colour image, found none");
  if (frame.color.type() != CV_8UC3) fail("expected colour as 8-bit BGR (CV_8UC3), found " + cv::typeToString(frame.color.type()));
  frame.camera.Check();
  if (frame.color.cols != frame.camera.width || frame.color.rows != frame.camera.height)
    fail("expected colour of the camera's size " + std::to_string(frame.camera.width) + "x" + std::to_string(frame.camera.height) +
         ", found " + Size(frame.color));
  if (frame.depth.empty()) return;
  if (frame.depth.type() != CV_16UC1)
    fail("expected depth as 16-bit millimetres (CV_16UC1), found " + cv::typeToString(frame.depth.type()));
  if (frame.depth.size() != frame.color.size())
    fail("expected depth as large as colour (" + Size(frame.color) + "), found " + Size(frame.depth));
}

}  // namespace vantage::rgbd
