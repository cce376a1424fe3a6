#include "rendering/mip_texture.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/core/hal/intrin.hpp>
#include <opencv2/imgproc.hpp>

namespace vantage::rendering {
namespace {

constexpr float kMostProbes = 8.0f;

int Wrapped(int i, int size) {
  if (static_cast<unsigned>(i) < static_cast<unsigned>(size)) return i;
  i %= size;
  return i < 0 ? i + size : i;
}

int Floor(float x) {
  const int i = static_cast<int>(x);
  return i - (static_cast<float>(i) > x ? 1 : 0);
}

float Length(float x, float y) { return std::sqrt(x * x + y * y); }

// Texture filtering does not need the logarithm to more than this (error < 0.09): the exponent, and the mantissa as it is.
float RoughLog2(float x) {
  std::uint32_t bits;
  std::memcpy(&bits, &x, sizeof(bits));
  return static_cast<float>(static_cast<int>(bits >> 23) - 127) + static_cast<float>(bits & 0x7fffffu) * (1.0f / 8388608.0f);
}

// Four bytes, of which three are a colour.
cv::v_float32x4 Texel(const std::uint8_t* p) { return cv::v_cvt_f32(cv::v_reinterpret_as_s32(cv::v_load_expand_q(p))); }

cv::v_float32x4 Mix(const cv::v_float32x4& a, const cv::v_float32x4& b, float w) { return a + (b - a) * cv::v_setall_f32(w); }

template <typename Level>
inline cv::v_float32x4 Bilinear(const Level& level, float u, float v_down) {
  const float x = u * static_cast<float>(level.columns) - 0.5f, y = v_down * static_cast<float>(level.rows) - 0.5f;
  const int x_floor = Floor(x), y_floor = Floor(y);
  const float wx = x - static_cast<float>(x_floor), wy = y - static_cast<float>(y_floor);
  const int x0 = Wrapped(x_floor, level.columns), x1 = x0 + 1 < level.columns ? x0 + 1 : 0;
  const int y0 = Wrapped(y_floor, level.rows), y1 = y0 + 1 < level.rows ? y0 + 1 : 0;
  const std::uint8_t* top = level.data + static_cast<std::size_t>(y0) * level.step;
  const std::uint8_t* bottom = level.data + static_cast<std::size_t>(y1) * level.step;
  return Mix(Mix(Texel(top + 3 * x0), Texel(top + 3 * x1), wx), Mix(Texel(bottom + 3 * x0), Texel(bottom + 3 * x1), wx), wy);
}

}  // namespace

MipTexture::MipTexture(const cv::Mat& texture) {
  cv::Mat image = texture;
  while (true) {
    Level level;
    level.columns = image.cols;
    level.rows = image.rows;
    level.image.create(image.rows + 1, image.cols, CV_8UC3);
    image.copyTo(level.image.rowRange(0, image.rows));
    level.data = level.image.data;
    level.step = level.image.step;
    levels_.push_back(level);
    if (image.cols == 1 && image.rows == 1) break;
    cv::Mat half;
    cv::resize(image, half, {std::max(1, image.cols / 2), std::max(1, image.rows / 2)}, 0, 0, cv::INTER_AREA);
    image = half;
  }
  // The last row's last texel reads one byte beyond it.
  for (Level& level : levels_) level.image.row(level.rows).setTo(cv::Scalar::all(0));
}

Eigen::Vector3f MipTexture::Sample(const Eigen::Vector2f& uv, const Eigen::Vector2f& duv_dx, const Eigen::Vector2f& duv_dy) const {
  const float columns = static_cast<float>(levels_[0].columns), rows = static_cast<float>(levels_[0].rows);
  const float length_x = Length(duv_dx.x() * columns, duv_dx.y() * rows);
  const float length_y = Length(duv_dy.x() * columns, duv_dy.y() * rows);
  const Eigen::Vector2f& long_axis = length_x > length_y ? duv_dx : duv_dy;
  const float longest = std::max(length_x, length_y);
  const float shortest = std::max({std::min(length_x, length_y), longest / kMostProbes, 1e-6f});
  const int probes = longest <= 1.0f ? 1 : std::clamp(static_cast<int>(longest / (1.25f * std::max(shortest, 1.0f)) + 0.5f), 1, 8);

  const int last = static_cast<int>(levels_.size()) - 1;
  const float level = std::clamp(RoughLog2(shortest), 0.0f, static_cast<float>(last));
  const int fine = static_cast<int>(level), coarse = std::min(fine + 1, last);
  // Blending is narrowed to the middle half between two levels: elsewhere one level is read instead of two.
  const float w = std::clamp(2.0f * (level - static_cast<float>(fine)) - 0.5f, 0.0f, 1.0f);
  cv::v_float32x4 sum = cv::v_setzero_f32();
  for (int i = 0; i < probes; ++i) {
    const float along = (static_cast<float>(i) + 0.5f) / static_cast<float>(probes) - 0.5f;
    const float u = uv.x() + along * long_axis.x(), v_down = 1.0f - (uv.y() + along * long_axis.y());
    if (w <= 0.0f) {
      sum += Bilinear(levels_[fine], u, v_down);
    } else if (w >= 1.0f) {
      sum += Bilinear(levels_[coarse], u, v_down);
    } else {
      sum += Mix(Bilinear(levels_[fine], u, v_down), Bilinear(levels_[coarse], u, v_down), w);
    }
  }
  alignas(16) float mean[4];
  cv::v_store_aligned(mean, sum * cv::v_setall_f32(1.0f / static_cast<float>(probes)));
  return {mean[0], mean[1], mean[2]};
}

}  // namespace vantage::rendering
