#include "simulation/depth_sensor.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/imgproc.hpp>
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

// Standard normal deviates, neighbours alike as far as asked.
cv::Mat NoiseField(const cv::Size& size, const SensorParams& params, NoiseTable::Stream* noise) {
  cv::Mat field(size, CV_32FC1);
  for (int y = 0; y < size.height; ++y) {
    float* row = field.ptr<float>(y);
    for (int x = 0; x < size.width; ++x) row[x] = noise->Next();
  }
  if (params.noise_correlation_px <= 0.0) return field;
  const int reach = static_cast<int>(std::ceil(3.0 * params.noise_correlation_px));
  const cv::Mat kernel = cv::getGaussianKernel(2 * reach + 1, params.noise_correlation_px, CV_32F);
  cv::sepFilter2D(field, field, CV_32F, kernel / cv::norm(kernel), kernel / cv::norm(kernel), {-1, -1}, 0.0,
                  cv::BORDER_REFLECT_101);
  return field;
}

// The noise that, with the quantisation's own (a step's deviation is step / sqrt(12)), makes the whole.
double NoiseSigma(double z, double disparity_m, const SensorParams& params) {
  const double whole = params.noise_base_m + params.noise_slope * (z - 0.4) * (z - 0.4);
  if (!params.depth_quantised) return whole;
  const double step = z * z / disparity_m;
  return std::sqrt(std::max(0.0, whole * whole - step * step / 12.0));
}

// Marks the pixels of a row that a device beside the camera cannot see: `shift_px` / z is how far its image of a point is from the
// camera's, to the left where the device is to the right. Between it and them is something nearer, which its image shows there.
void MarkHidden(const float* depth, float shift_px, bool device_on_right, std::vector<std::uint8_t>* hidden) {
  constexpr float kSlack_px = 0.25f;
  const int width = static_cast<int>(hidden->size());
  float nearest_edge = 1e9f;
  for (int i = 0; i < width; ++i) {
    const int x = device_on_right ? width - 1 - i : i;
    if (!(depth[x] > 0.0f)) continue;
    // Falls along the row as it is walked, but where something nearer was passed.
    const float seen_at = static_cast<float>(device_on_right ? x : -x) - shift_px / depth[x];
    if (seen_at > nearest_edge + kSlack_px) (*hidden)[x] = 1;
    nearest_edge = std::min(nearest_edge, seen_at);
  }
}

void MarkShadows(const float* depth, const SensorParams& params, std::vector<std::uint8_t>* shadow) {
  const double projector_px = params.focal_length_px * params.projector_m;
  const double camera_px = params.focal_length_px * (params.baseline_m - params.projector_m);
  if (projector_px > 0.0) MarkHidden(depth, static_cast<float>(projector_px), true, shadow);
  if (camera_px > 0.0) MarkHidden(depth, static_cast<float>(camera_px), false, shadow);
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
  const cv::Mat normal = NoiseField(image.depth.size(), params, &noise);
  const float least_cos = static_cast<float>(std::cos(params.max_grazing_deg * M_PI / 180.0));
  const double disparity_m = params.focal_length_px * params.baseline_m / params.disparity_step_px;  // In steps, times depth.
  std::vector<std::uint8_t> shadow(measured.cols);
  for (int y = 0; y < measured.rows; ++y) {
    std::fill(shadow.begin(), shadow.end(), std::uint8_t{0});
    if (params.depth_shadows) MarkShadows(image.depth.ptr<float>(y), params, &shadow);
    for (int x = 0; x < measured.cols; ++x) {
      double z = image.depth.at<float>(y, x);
      if (!(z > 0.0) || shadow[x]) continue;
      const float deviate = normal.at<float>(y, x);
      if (params.depth_holes && (image.grazing.at<float>(y, x) < least_cos || IsLostAtJump(image.depth, x, y, deviate))) continue;
      if (params.depth_noise) z += deviate * NoiseSigma(z, disparity_m, params);
      if (params.depth_quantised) z = disparity_m / std::max(1.0, std::round(disparity_m / z));
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
