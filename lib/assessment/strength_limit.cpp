#include "assessment/strength_limit.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <vector>

namespace vantage::assessment {
namespace {

constexpr std::uint32_t kSeed = 1;  // Of the noise: any will do, the limit is one over hundreds of points.

// Where a window of this size holds the most points, in steps of half a window.
std::pair<cv::Rect, int> Densest(const cv::Size& image, const features::Features& features, const cv::Size& size) {
  cv::Rect densest({0, 0}, size);
  int most = -1;
  for (int y = 0; y + size.height <= image.height; y += std::max(1, size.height / 2)) {
    for (int x = 0; x + size.width <= image.width; x += std::max(1, size.width / 2)) {
      const cv::Rect2f window(static_cast<float>(x), static_cast<float>(y), static_cast<float>(size.width),
                              static_cast<float>(size.height));
      const auto inside = std::count_if(features.keypoints.begin(), features.keypoints.end(),
                                        [&](const cv::KeyPoint& keypoint) { return window.contains(keypoint.pt); });
      if (inside <= most) continue;
      most = static_cast<int>(inside);
      densest = cv::Rect({x, y}, size);
    }
  }
  return {densest, most};
}

}  // namespace

StrengthLimit::StrengthLimit(const cv::Mat& image, const features::Features& kept, const features::FeatureParams& params,
                             const cv::Size& patch)
    : params_(params) {
  if (image.empty() || image.type() != CV_8UC3) throw std::invalid_argument("StrengthLimit: the image must be CV_8UC3");
  const cv::Size size(std::min(patch.width, image.cols), std::min(patch.height, image.rows));
  const auto [window, count] = Densest(image.size(), kept, size);
  patch_ = image(window).clone();
  if (kept.size() > 0)
    kept_in_patch_ = static_cast<int>(std::lround(static_cast<double>(params.max_keypoints) * count / kept.size()));
}

double StrengthLimit::Response(const Disturbance& disturbance) {
  const auto key = std::make_pair(disturbance.blur_px, disturbance.image_noise);
  auto found = responses_.find(key);
  if (found == responses_.end()) found = responses_.emplace(key, Measure(key.first, key.second)).first;
  return found->second * disturbance.brightness;
}

double StrengthLimit::Measure(double blur_px, double image_noise) const {
  if (kept_in_patch_ == 0) return 0.0;
  Disturbance disturbance;
  disturbance.blur_px = blur_px;
  disturbance.image_noise = image_noise;
  cv::Mat image = patch_.clone(), gray;
  Disturb(disturbance, kSeed, &image);
  cv::cvtColor(image, gray, cv::COLOR_BGR2GRAY);
  std::vector<float> responses;
  for (const cv::KeyPoint& keypoint : features::Extract(gray, cv::Mat(), params_).keypoints) responses.push_back(keypoint.response);
  if (static_cast<int>(responses.size()) <= kept_in_patch_) return 0.0;
  const auto weakest = responses.begin() + (kept_in_patch_ - 1);
  std::nth_element(responses.begin(), weakest, responses.end(), std::greater<>());
  return *weakest;
}

features::Features ExtractStrong(const cv::Mat& gray, const features::FeatureParams& params, double min_response) {
  constexpr double kSiftLayers = 3.0;  // OpenCV's threshold is on the response times the layers of an octave.
  features::FeatureParams strict = params;
  if (params.type == "sift") strict.contrast_threshold = std::max(params.contrast_threshold, kSiftLayers * min_response);
  const features::Features features = features::Extract(gray, cv::Mat(), strict);
  std::vector<int> strong;
  for (int i = 0; i < features.size(); ++i) {
    if (features.keypoints[static_cast<std::size_t>(i)].response >= min_response) strong.push_back(i);
  }
  return features::Select(features, strong);
}

}  // namespace vantage::assessment
