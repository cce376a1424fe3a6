#include "simulation/motion_blur.h"

#include <algorithm>
#include <cmath>

namespace vantage::simulation {
namespace {

constexpr float kStill_px = 0.25f;
constexpr int kMostSamples = 48;

// The path of a pixel while the shutter is open as a function of its 1 / z: fixed along a row but for the column.
struct RowMotion {
  float fx, fy, b, scale;
  Eigen::Vector3f v, w;

  // `a` is the column's (x - cx) / fx. ImageMotion, times the exposure.
  Eigen::Vector2f Path(float a, float inverse_depth) const {
    return {scale * fx * ((a * v.z() - v.x()) * inverse_depth + a * b * w.x() - (1 + a * a) * w.y() + b * w.z()),
            scale * fy * ((b * v.z() - v.y()) * inverse_depth + (1 + b * b) * w.x() - a * b * w.y() - a * w.z())};
  }
};

// Adds the colour between pixels (bilinear, at the border the nearest), times 256. (x, y) in 256ths of a pixel.
inline void AddSample(const cv::Mat& color, int x, int y, int* sum) {
  x = std::clamp(x, 0, 256 * (color.cols - 1) - 1);
  y = std::clamp(y, 0, 256 * (color.rows - 1) - 1);
  const int right = x & 255, below = y & 255;
  const std::uint8_t* a = color.data + static_cast<std::size_t>(y >> 8) * color.step[0] + 3 * (x >> 8);
  const std::uint8_t* b = a + color.step[0];
  const int w11 = (right * below) >> 8, w10 = right - w11, w01 = below - w11, w00 = 256 - right - w01;
  for (int c = 0; c < 3; ++c) sum[c] += w00 * a[c] + w10 * a[c + 3] + w01 * b[c] + w11 * b[c + 3];
}

void AverageAlong(const Eigen::Vector2f& path, float length_px, int x, int y, const cv::Mat& sharp, std::uint8_t* out) {
  const int samples = std::clamp(static_cast<int>(std::ceil(length_px)), 2, kMostSamples);
  const Eigen::Vector2f step = 256.0f / static_cast<float>(samples) * path;
  Eigen::Vector2f at(256.0f * static_cast<float>(x), 256.0f * static_cast<float>(y));
  at -= 0.5f * static_cast<float>(samples - 1) * step;
  int sum[3] = {128 * samples, 128 * samples, 128 * samples};
  for (int i = 0; i < samples; ++i, at += step) AddSample(sharp, static_cast<int>(at.x()), static_cast<int>(at.y()), sum);
  for (int c = 0; c < 3; ++c) out[c] = static_cast<std::uint8_t>(std::min(255, sum[c] / (256 * samples)));
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
  RowMotion motion{static_cast<float>(camera.fx),  static_cast<float>(camera.fy),  0.0f,
                   static_cast<float>(exposure_s), twist.linear_m_s.cast<float>(), twist.angular_rad_s.cast<float>()};
  for (int y = 0; y < sharp.rows; ++y) {
    const float* z = depth.ptr<float>(y);
    std::uint8_t* out = color->ptr<std::uint8_t>(y);
    motion.b = static_cast<float>((y - camera.cy) / camera.fy);
    for (int x = 0; x < sharp.cols; ++x) {
      const float a = static_cast<float>((x - camera.cx) / camera.fx);
      const Eigen::Vector2f path = motion.Path(a, z[x] > 0.0f ? 1.0f / z[x] : 0.0f);
      const float length_px = path.norm();
      if (length_px > kStill_px) AverageAlong(path, length_px, x, y, sharp, out + 3 * x);
    }
  }
}

}  // namespace vantage::simulation
