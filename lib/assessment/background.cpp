#include "assessment/background.h"

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <vector>

#include "assessment/dice.h"
#include "assessment/virtual_object.h"

namespace vantage::assessment {

cv::Mat MaskedBackground(const cv::Mat& color, const cv::Mat& mask) {
  if (color.type() != CV_8UC3 || mask.type() != CV_8UC1 || color.size() != mask.size()) {
    throw std::invalid_argument("background: expected a CV_8UC3 image and a CV_8UC1 mask of its size");
  }
  cv::Mat grown;
  cv::dilate(mask, grown, cv::getStructuringElement(cv::MORPH_ELLIPSE, {9, 9}));
  // Normalised blur: every masked pixel becomes the mean of the unmasked ones around it, in rings that grow until all are filled.
  cv::Mat known, filled;
  cv::Mat(grown == 0).convertTo(known, CV_32F, 1.0 / 255.0);
  color.convertTo(filled, CV_32FC3);
  cv::Mat known3;
  cv::merge(std::vector<cv::Mat>{known, known, known}, known3);
  filled = filled.mul(known3);
  cv::Mat result = color.clone();
  cv::Mat missing = grown.clone();
  for (int size = 15; cv::countNonZero(missing) > 0 && size < 2 * std::max(color.cols, color.rows); size = 2 * size + 1) {
    cv::Mat sum, weight;
    cv::blur(filled, sum, {size, size});
    cv::blur(known, weight, {size, size});
    for (int y = 0; y < color.rows; ++y) {
      for (int x = 0; x < color.cols; ++x) {
        if (!missing.at<uchar>(y, x) || weight.at<float>(y, x) < 0.02f) continue;
        result.at<cv::Vec3b>(y, x) = cv::Vec3b(sum.at<cv::Vec3f>(y, x) / weight.at<float>(y, x));
        missing.at<uchar>(y, x) = 0;
      }
    }
  }
  return result;
}

cv::Mat WithLookAlike(const cv::Mat& color, const model::ObjectModel& other, std::uint32_t seed) {
  constexpr double kMaxRotationRad = M_PI / 6.0;
  std::vector<int> shown;
  for (std::size_t i = 0; i < other.views.size(); ++i) {
    if (!other.views[i].keyframe.depth.empty() && !other.views[i].mask.empty()) shown.push_back(static_cast<int>(i));
  }
  if (shown.empty()) return color;
  Dice dice({seed});
  const model::ObjectModel one = other.OnlyView(shown[static_cast<std::size_t>(dice.Index(static_cast<int>(shown.size())))]);
  VirtualPose pose;
  pose.rotation_rad = dice.Uniform(0.0, kMaxRotationRad);
  pose.tilt_rad = dice.Uniform(0.0, 2.0 * M_PI);
  const geometry::Rigid T_camera_object = VirtualCameraPose(one.views.front(), pose);
  const VirtualObject surface(one);
  const VirtualImage image = surface.Render(surface.Window(0, T_camera_object, color.cols, color.rows), T_camera_object);
  const cv::Rect place({dice.Index(color.cols - image.color.cols + 1), dice.Index(color.rows - image.color.rows + 1)},
                       image.color.size());
  cv::Mat result = color.clone();
  Paste(image, result(place)).copyTo(result(place));
  return result;
}

}  // namespace vantage::assessment
