#include "rendering/mip_texture.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace vantage::rendering {
namespace {

constexpr float kMostProbes = 8.0f;

int Wrapped(int i, int size) {
  if (i >= 0 && i < size) return i;
  i %= size;
  return i < 0 ? i + size : i;
}

Eigen::Vector3f Texel(const std::uint8_t* p) {
  return {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
}

}  // namespace

MipTexture::MipTexture(const cv::Mat& texture) {
  levels_.push_back(texture);
  while (levels_.back().cols > 1 || levels_.back().rows > 1) {
    const cv::Size size(std::max(1, levels_.back().cols / 2), std::max(1, levels_.back().rows / 2));
    cv::Mat half;
    cv::resize(levels_.back(), half, size, 0, 0, cv::INTER_AREA);
    levels_.push_back(half);
  }
}

Eigen::Vector3f MipTexture::Bilinear(int level, float u, float v_down) const {
  const cv::Mat& image = levels_[level];
  const float x = u * static_cast<float>(image.cols) - 0.5f, y = v_down * static_cast<float>(image.rows) - 0.5f;
  const float x_floor = std::floor(x), y_floor = std::floor(y);
  const float wx = x - x_floor, wy = y - y_floor;
  const int x0 = Wrapped(static_cast<int>(x_floor), image.cols), x1 = x0 + 1 < image.cols ? x0 + 1 : 0;
  const int y0 = Wrapped(static_cast<int>(y_floor), image.rows), y1 = y0 + 1 < image.rows ? y0 + 1 : 0;
  const std::uint8_t* top = image.ptr<std::uint8_t>(y0);
  const std::uint8_t* bottom = image.ptr<std::uint8_t>(y1);
  return (1 - wy) * ((1 - wx) * Texel(top + 3 * x0) + wx * Texel(top + 3 * x1)) +
         wy * ((1 - wx) * Texel(bottom + 3 * x0) + wx * Texel(bottom + 3 * x1));
}

Eigen::Vector3f MipTexture::Trilinear(float level, float u, float v_down) const {
  const int last = static_cast<int>(levels_.size()) - 1;
  if (level <= 0.0f) return Bilinear(0, u, v_down);
  if (level >= static_cast<float>(last)) return Bilinear(last, u, v_down);
  const int fine = static_cast<int>(level);
  const float w = level - static_cast<float>(fine);
  const Eigen::Vector3f color = Bilinear(fine, u, v_down);
  return w < 0.02f ? color : Eigen::Vector3f((1 - w) * color + w * Bilinear(fine + 1, u, v_down));
}

Eigen::Vector3f MipTexture::Sample(const Eigen::Vector2f& uv, const Eigen::Vector2f& duv_dx, const Eigen::Vector2f& duv_dy) const {
  const Eigen::Array2f size(static_cast<float>(levels_[0].cols), static_cast<float>(levels_[0].rows));
  const float length_x = (duv_dx.array() * size).matrix().norm(), length_y = (duv_dy.array() * size).matrix().norm();
  const Eigen::Vector2f& long_axis = length_x > length_y ? duv_dx : duv_dy;
  const float longest = std::max(length_x, length_y);
  const float shortest = std::max({std::min(length_x, length_y), longest / kMostProbes, 1e-6f});
  const float level = std::log2(shortest);
  const int probes = longest <= 1.0f ? 1 : std::clamp(static_cast<int>(std::lround(longest / std::max(shortest, 1.0f))), 1, 8);
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  for (int i = 0; i < probes; ++i) {
    const float along = (static_cast<float>(i) + 0.5f) / static_cast<float>(probes) - 0.5f;
    const Eigen::Vector2f at = uv + along * long_axis;
    sum += Trilinear(level, at.x(), 1.0f - at.y());
  }
  return sum / static_cast<float>(probes);
}

}  // namespace vantage::rendering
