#include "simulation/motion_blur.h"

#include <algorithm>
#include <cmath>

namespace vantage::simulation {
namespace {

constexpr float kStill_px = 0.25f;
constexpr int kMostSamples = 48;

// Adds the colour between pixels (bilinear, at the border the nearest).
void AddSample(const cv::Mat& color, float x, float y, float* sum) {
  x = std::clamp(x, 0.0f, static_cast<float>(color.cols - 1) - 1e-3f);
  y = std::clamp(y, 0.0f, static_cast<float>(color.rows - 1) - 1e-3f);
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const float right = x - static_cast<float>(x0), below = y - static_cast<float>(y0);
  const std::uint8_t* a = color.ptr<std::uint8_t>(y0) + 3 * x0;
  const std::uint8_t* b = color.ptr<std::uint8_t>(y0 + 1) + 3 * x0;
  const float w00 = (1 - right) * (1 - below), w10 = right * (1 - below), w01 = (1 - right) * below, w11 = right * below;
  for (int c = 0; c < 3; ++c) sum[c] += w00 * a[c] + w10 * a[c + 3] + w01 * b[c] + w11 * b[c + 3];
}

}  // namespace

Twist TwistBetween(const geometry::Rigid& T_world_from, const geometry::Rigid& T_world_to, double time_s) {
  const geometry::Rigid T_from_to = T_world_from.inverse() * T_world_to;
  const Eigen::AngleAxisd turn(T_from_to.linear());
  return {T_from_to.translation() / time_s, turn.angle() / time_s * turn.axis()};
}

Eigen::Vector2d ImageMotion(const geometry::PinholeCamera& camera, const Eigen::Vector2d& pixel, double inverse_depth,
                            const Twist& twist) {
  const double a = (pixel.x() - camera.cx) / camera.fx, b = (pixel.y() - camera.cy) / camera.fy;
  const Eigen::Vector3d& v = twist.linear_m_s;
  const Eigen::Vector3d& w = twist.angular_rad_s;
  // The point moves by -(v + w x X) in camera coordinates; its projection's derivative along that.
  return {camera.fx * ((a * v.z() - v.x()) * inverse_depth + a * b * w.x() - (1 + a * a) * w.y() + b * w.z()),
          camera.fy * ((b * v.z() - v.y()) * inverse_depth + (1 + b * b) * w.x() - a * b * w.y() - a * w.z())};
}

void BlurByMotion(const cv::Mat& depth, const geometry::PinholeCamera& camera, const Twist& twist, double exposure_s,
                  cv::Mat* color) {
  if (exposure_s <= 0.0 || (twist.linear_m_s.isZero() && twist.angular_rad_s.isZero())) return;
  if (color->rows < 2 || color->cols < 2) return;
  const cv::Mat sharp = color->clone();
  for (int y = 0; y < sharp.rows; ++y) {
    const float* z = depth.ptr<float>(y);
    std::uint8_t* out = color->ptr<std::uint8_t>(y);
    for (int x = 0; x < sharp.cols; ++x) {
      const Eigen::Vector2f path = (exposure_s * ImageMotion(camera, {x, y}, z[x] > 0.0f ? 1.0 / z[x] : 0.0, twist)).cast<float>();
      const float length = path.norm();
      if (length < kStill_px) continue;
      const int samples = std::clamp(static_cast<int>(std::ceil(length)) + 1, 2, kMostSamples);
      float sum[3] = {0.5f, 0.5f, 0.5f};
      for (int i = 0; i < 3; ++i) sum[i] *= static_cast<float>(samples);
      for (int i = 0; i < samples; ++i) {
        const float at = (static_cast<float>(i) + 0.5f) / static_cast<float>(samples) - 0.5f;
        AddSample(sharp, static_cast<float>(x) + at * path.x(), static_cast<float>(y) + at * path.y(), sum);
      }
      for (int c = 0; c < 3; ++c)
        out[3 * x + c] = static_cast<std::uint8_t>(std::min(255.0f, sum[c] / static_cast<float>(samples)));
    }
  }
}

}  // namespace vantage::simulation
