#include "simulation/depth_sensor.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>

namespace vantage::simulation {
namespace {

constexpr std::size_t kTableSize = 1 << 16;

std::uint64_t Mixed(std::uint64_t x) {
  x ^= x >> 30;
  x *= 0xbf58476d1ce4e5b9ull;
  x ^= x >> 27;
  x *= 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

// A jump in depth that a structured-light sensor does not see across.
float JumpAt(float depth_m) { return 0.01f + 0.02f * depth_m; }

// Whether the projector's pattern is lost at a pixel: behind a nearer surface always (two pixels wide, the second by chance), on
// the rim of the nearer one by chance.
bool IsLostAtJump(const cv::Mat& depth, int x, int y, float chance) {
  const float z = depth.at<float>(y, x), jump = JumpAt(z);
  for (int reach = 1; reach <= 2; ++reach) {
    for (const auto& [dx, dy] : {std::pair{-reach, 0}, {reach, 0}, {0, -reach}, {0, reach}}) {
      const int nx = x + dx, ny = y + dy;
      if (nx < 0 || ny < 0 || nx >= depth.cols || ny >= depth.rows) continue;
      const float other = depth.at<float>(ny, nx);
      if (other > 0.0f && z - other > jump * static_cast<float>(reach) && (reach == 1 || chance > 0.0f)) return true;
      if (reach == 1 && other - z > jump && chance > 0.7f) return true;
    }
  }
  return false;
}

}  // namespace

NoiseTable::NoiseTable() {
  std::mt19937 random(1);
  const auto uniform = [&random] { return (random() + 0.5) / 4294967296.0; };
  while (table_.size() < kTableSize) {  // Box and Muller, 1958.
    const double radius = std::sqrt(-2.0 * std::log(uniform())), angle = 2.0 * M_PI * uniform();
    table_.push_back(static_cast<float>(radius * std::cos(angle)));
    table_.push_back(static_cast<float>(radius * std::sin(angle)));
  }
}

float NoiseTable::Stream::Next() {
  if (left_ == 0) {
    bits_ = Mixed(state_ += 0x9e3779b97f4a7c15ull);
    left_ = 4;
  }
  const float value = table_[bits_ & (kTableSize - 1)];
  bits_ >>= 16;
  --left_;
  return value;
}

std::uint64_t SeedOf(const geometry::Rigid& pose, std::uint32_t seed) {
  std::uint64_t hash = Mixed(seed + 1ull);
  for (int i = 0; i < 12; ++i) {
    const double value = pose.matrix()(i / 4, i % 4) + 0.0;  // No negative zero.
    std::uint64_t bits;
    std::memcpy(&bits, &value, sizeof(bits));
    hash = Mixed(hash ^ bits) + 0x9e3779b97f4a7c15ull;
  }
  return hash;
}

cv::Mat MeasuredDepth(const rendering::Image& image, const SensorParams& params, NoiseTable::Stream noise) {
  cv::Mat measured = cv::Mat::zeros(image.depth.size(), CV_16UC1);
  const float least_cos = static_cast<float>(std::cos(params.max_grazing_deg * M_PI / 180.0));
  for (int y = 0; y < measured.rows; ++y) {
    for (int x = 0; x < measured.cols; ++x) {
      const float depth = image.depth.at<float>(y, x);
      const float normal = noise.Next();  // One for every pixel, so that a hole does not shift the noise behind it.
      if (!(depth > 0.0f)) continue;
      if (params.depth_holes && (image.grazing.at<float>(y, x) < least_cos || IsLostAtJump(image.depth, x, y, normal))) continue;
      double z = depth;
      if (params.depth_noise) z += normal * (params.noise_base_m + params.noise_slope * (z - 0.4) * (z - 0.4));
      if (z < params.min_depth_m || z > params.max_depth_m) continue;
      measured.at<std::uint16_t>(y, x) = cv::saturate_cast<std::uint16_t>(z * 1000.0);
    }
  }
  return measured;
}

void AddImageNoise(double sigma, NoiseTable::Stream noise, cv::Mat* image) {
  if (sigma <= 0.0) return;
  const float scale = static_cast<float>(sigma);
  for (int y = 0; y < image->rows; ++y) {
    std::uint8_t* row = image->ptr<std::uint8_t>(y);
    for (int i = 0; i < 3 * image->cols; ++i) {
      const int value = static_cast<int>(static_cast<float>(row[i]) + scale * noise.Next() + 256.5f) - 256;
      row[i] = static_cast<std::uint8_t>(std::clamp(value, 0, 255));
    }
  }
}

}  // namespace vantage::simulation
