#include <cmath>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "features/features.h"
#include "features/surf.h"

namespace vantage::features {
namespace {

// Pixels around the mask's bounding box, so that blobs at its border keep their surroundings. SURF describes a point by all within
// 16 times its scale.
int MaskMargin(const FeatureParams& params) { return params.type == "surf" ? 64 : 24; }

// RootSIFT (Arandjelovic and Zisserman, 2012): Euclidean distance then compares histograms by the Hellinger kernel.
void RootNormalise(cv::Mat* descriptors) {
  for (int row = 0; row < descriptors->rows; ++row) {
    float* d = descriptors->ptr<float>(row);
    float sum = 0.f;
    for (int i = 0; i < descriptors->cols; ++i) sum += d[i];
    const float scale = sum > 0.f ? 1.f / sum : 0.f;
    for (int i = 0; i < descriptors->cols; ++i) d[i] = std::sqrt(d[i] * scale);
  }
}

cv::Rect WorkingArea(const cv::Mat& gray, const cv::Mat& mask, int margin) {
  const cv::Rect image(0, 0, gray.cols, gray.rows);
  if (mask.empty()) return image;
  const cv::Rect box = cv::boundingRect(mask);
  return cv::Rect(box.x - margin, box.y - margin, box.width + 2 * margin, box.height + 2 * margin) & image;
}

Features ExtractSift(const cv::Mat& gray, const cv::Mat& mask, const FeatureParams& params) {
  Features features;
  const cv::Ptr<cv::SIFT> sift = cv::SIFT::create(params.max_keypoints, 3, params.contrast_threshold);
  sift->detectAndCompute(gray, mask, features.keypoints, features.descriptors);
  if (features.descriptors.empty()) features.descriptors = cv::Mat(0, 128, CV_32F);
  RootNormalise(&features.descriptors);
  return features;
}

}  // namespace

void FeatureParams::Check() const {
  const auto require = [](bool ok, const std::string& what) {
    if (!ok) throw std::invalid_argument("features: " + what);
  };
  require(type == "sift" || type == "surf", "type must be \"sift\" or \"surf\", is \"" + type + "\"");
  require(max_keypoints >= 1, "max_keypoints must be >= 1, is " + std::to_string(max_keypoints));
  require(contrast_threshold > 0.0, "contrast_threshold must be > 0, is " + std::to_string(contrast_threshold));
}

std::string FeatureParams::Fingerprint() const {
  return type + ":" + std::to_string(max_keypoints) + ":" + std::to_string(contrast_threshold);
}

Features Extract(const cv::Mat& gray, const cv::Mat& mask, const FeatureParams& params) {
  if (gray.empty() || gray.type() != CV_8UC1) throw std::invalid_argument("features: expected a CV_8UC1 image");
  if (!mask.empty() && (mask.type() != CV_8UC1 || mask.size() != gray.size())) {
    throw std::invalid_argument("features: the mask must be CV_8UC1 and as large as the image");
  }
  if (!mask.empty() && cv::countNonZero(mask) == 0) return Features();
  const cv::Rect area = WorkingArea(gray, mask, MaskMargin(params));
  const cv::Mat inside = mask.empty() ? cv::Mat() : mask(area);
  Features features = params.type == "surf" ? ExtractSurf(gray(area), inside, params) : ExtractSift(gray(area), inside, params);
  for (cv::KeyPoint& keypoint : features.keypoints) keypoint.pt += cv::Point2f(area.x, area.y);
  return features;
}

Features Select(const Features& features, const std::vector<int>& index) {
  Features selected;
  selected.descriptors.create(static_cast<int>(index.size()), features.descriptors.cols, CV_32F);
  for (size_t i = 0; i < index.size(); ++i) {
    selected.keypoints.push_back(features.keypoints[index[i]]);
    features.descriptors.row(index[i]).copyTo(selected.descriptors.row(static_cast<int>(i)));
  }
  return selected;
}

}  // namespace vantage::features
