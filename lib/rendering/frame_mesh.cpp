// MeshFromFrame: the surface that one RGB-D frame shows.
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "rendering/mesh.h"

namespace vantage::rendering {
namespace {

constexpr int kHoleRadius = 2;  // Holes up to this many pixels from measured depth on both sides are bridged.

// Depth between the nearest measured pixels along one image axis, metres; 0 where there are none on both sides or they are not on
// one surface.
float Bridge(const cv::Mat& depth_m, int x, int y, int step_x, int step_y, double max_jump_m) {
  float side[2] = {0.0f, 0.0f};
  int distance[2] = {0, 0};
  for (int s = 0; s < 2; ++s) {
    const int sign = s == 0 ? -1 : 1;
    for (int d = 1; d <= kHoleRadius && side[s] == 0.0f; ++d) {
      const int px = x + sign * d * step_x, py = y + sign * d * step_y;
      if (px < 0 || py < 0 || px >= depth_m.cols || py >= depth_m.rows) break;
      side[s] = depth_m.at<float>(py, px);
      distance[s] = d;
    }
  }
  const int apart = distance[0] + distance[1];
  if (side[0] == 0.0f || side[1] == 0.0f || std::abs(side[0] - side[1]) > max_jump_m * apart) return 0.0f;
  return (side[0] * static_cast<float>(distance[1]) + side[1] * static_cast<float>(distance[0])) / static_cast<float>(apart);
}

// The measured depth in metres inside `mask`, small holes bridged.
cv::Mat MaskedDepth(const rgbd::Frame& frame, const cv::Mat& mask, double max_jump_m) {
  cv::Mat measured;
  frame.depth.convertTo(measured, CV_32F, 1e-3);
  if (!mask.empty()) measured.setTo(0.0f, mask == 0);
  cv::Mat filled = measured.clone();
  for (int y = 0; y < measured.rows; ++y) {
    for (int x = 0; x < measured.cols; ++x) {
      if (measured.at<float>(y, x) != 0.0f || (!mask.empty() && mask.at<std::uint8_t>(y, x) == 0)) continue;
      float& depth = filled.at<float>(y, x);
      depth = Bridge(measured, x, y, 1, 0, max_jump_m);
      if (depth == 0.0f) depth = Bridge(measured, x, y, 0, 1, max_jump_m);
    }
  }
  return filled;
}

// The part of the image that is used as texture: what has depth, and a rim so that filtering finds neighbours.
cv::Rect TextureRegion(const cv::Mat& depth_m) {
  constexpr int kRim = 16;
  const cv::Rect used = cv::boundingRect(depth_m > 0.0f);
  return (used - cv::Point(kRim, kRim) + cv::Size(2 * kRim, 2 * kRim)) & cv::Rect({0, 0}, depth_m.size());
}

bool Joined(float a, float b, double max_step_m) { return std::abs(a - b) <= max_step_m; }

}  // namespace

Mesh MeshFromFrame(const rgbd::Frame& frame, const cv::Mat& mask, const geometry::Rigid& T_target_camera, int step_px,
                   double max_jump_m) {
  rgbd::CheckFrame(frame);
  if (step_px < 1) throw std::invalid_argument("MeshFromFrame: step_px must be >= 1");
  if (!mask.empty() && (mask.type() != CV_8UC1 || mask.size() != frame.color.size()))
    throw std::invalid_argument("MeshFromFrame: the mask must be CV_8UC1 and as large as the image");
  Mesh mesh;
  if (frame.depth.empty()) return mesh;
  const cv::Mat depth_m = MaskedDepth(frame, mask, max_jump_m);
  const cv::Rect region = TextureRegion(depth_m);
  if (region.empty()) return mesh;
  mesh.texture = frame.color(region).clone();

  const int columns = (depth_m.cols + step_px - 1) / step_px, rows = (depth_m.rows + step_px - 1) / step_px;
  std::vector<int> vertex_of(static_cast<std::size_t>(columns) * rows, -1);
  std::vector<float> depth_of(vertex_of.size(), 0.0f);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const int x = column * step_px, y = row * step_px;
      const float depth = depth_m.at<float>(y, x);
      if (depth <= 0.0f) continue;
      const std::size_t cell = static_cast<std::size_t>(row) * columns + column;
      vertex_of[cell] = static_cast<int>(mesh.vertices.size());
      depth_of[cell] = depth;
      mesh.vertices.push_back((T_target_camera * frame.camera.Unproject({x, y}, depth)).cast<float>());
      mesh.texture_uv.emplace_back((static_cast<float>(x - region.x) + 0.5f) / static_cast<float>(region.width),
                                   1.0f - (static_cast<float>(y - region.y) + 0.5f) / static_cast<float>(region.height));
    }
  }

  const double max_step_m = max_jump_m * step_px;
  const auto add = [&](std::size_t a, std::size_t b, std::size_t c) {
    if (vertex_of[a] < 0 || vertex_of[b] < 0 || vertex_of[c] < 0) return;
    if (!Joined(depth_of[a], depth_of[b], max_step_m) || !Joined(depth_of[b], depth_of[c], max_step_m) ||
        !Joined(depth_of[c], depth_of[a], max_step_m))
      return;
    mesh.triangles.emplace_back(vertex_of[a], vertex_of[b], vertex_of[c]);
  };
  for (int row = 0; row + 1 < rows; ++row) {
    for (int column = 0; column + 1 < columns; ++column) {
      const std::size_t top_left = static_cast<std::size_t>(row) * columns + column, bottom_left = top_left + columns;
      // Cut along the diagonal whose ends are nearer to each other: it keeps corners at depth edges.
      if (std::abs(depth_of[top_left] - depth_of[bottom_left + 1]) < std::abs(depth_of[top_left + 1] - depth_of[bottom_left])) {
        add(top_left, bottom_left, bottom_left + 1);
        add(top_left, bottom_left + 1, top_left + 1);
      } else {
        add(top_left, bottom_left, top_left + 1);
        add(top_left + 1, bottom_left, bottom_left + 1);
      }
    }
  }
  return mesh;
}

}  // namespace vantage::rendering
