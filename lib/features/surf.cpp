#include "features/surf.h"

#include <dlib/image_keypoint/surf.h>
#include <dlib/opencv/cv_image.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/core/utility.hpp>

namespace vantage::features {
namespace {

constexpr int kLength = 64;
constexpr int kOctaves = 4, kIntervals = 6, kFirstStep = 2;  // Of the pyramid, as dlib's own get_surf_points has them.
constexpr double kSurroundings = 32.0;  // Side of what describes a point, in scales, turned whichever way (dlib's figure).

using Integral = dlib::integral_image_generic<std::int32_t>;

// The determinant of the Hessian goes with the square of the contrast.
double ThresholdOf(const FeatureParams& params) {
  const double contrast = 255.0 * params.contrast_threshold;
  return contrast * contrast;
}

bool IsDescribable(const Integral& integral, const dlib::interest_point& point) {
  const auto side = static_cast<unsigned long>(kSurroundings * point.scale);
  return dlib::get_rect(integral).contains(dlib::centered_rect(point.center, side, side));
}

std::vector<dlib::interest_point> Detect(const Integral& integral, const cv::Mat& mask, const FeatureParams& params) {
  dlib::hessian_pyramid pyramid;
  pyramid.build_pyramid(integral, kOctaves, kIntervals, kFirstStep);
  std::vector<dlib::interest_point> points;
  dlib::get_interest_points(pyramid, ThresholdOf(params), points);
  const auto is_out = [&](const dlib::interest_point& point) {
    const cv::Point at(cvRound(point.center.x()), cvRound(point.center.y()));
    return !IsDescribable(integral, point) || (!mask.empty() && mask.at<uchar>(at) == 0);
  };
  points.erase(std::remove_if(points.begin(), points.end(), is_out), points.end());
  std::stable_sort(points.begin(), points.end(), [](const auto& a, const auto& b) { return a.score > b.score; });
  if (static_cast<int>(points.size()) > params.max_keypoints) points.resize(params.max_keypoints);
  return points;
}

}  // namespace

Features ExtractSurf(const cv::Mat& gray, const cv::Mat& mask, const FeatureParams& params) {
  Integral integral;
  integral.load(dlib::cv_image<unsigned char>(gray));
  const std::vector<dlib::interest_point> points = Detect(integral, mask, params);
  Features features;
  features.keypoints.resize(points.size());
  features.descriptors.create(static_cast<int>(points.size()), kLength, CV_32F);
  cv::parallel_for_(cv::Range(0, static_cast<int>(points.size())), [&](const cv::Range& range) {
    dlib::matrix<double, kLength, 1> descriptor;
    for (int i = range.start; i < range.end; ++i) {
      const dlib::interest_point& point = points[i];
      const double angle = dlib::compute_dominant_angle(integral, point.center, point.scale);
      dlib::compute_surf_descriptor(integral, point.center, point.scale, angle, descriptor);
      std::copy(descriptor.begin(), descriptor.end(), features.descriptors.ptr<float>(i));
      cv::KeyPoint& keypoint = features.keypoints[i];
      keypoint.pt = cv::Point2f(static_cast<float>(point.center.x()), static_cast<float>(point.center.y()));
      keypoint.size = static_cast<float>(2.0 * point.scale);
      keypoint.angle = static_cast<float>(angle * 180.0 / M_PI) + (angle < 0.0 ? 360.f : 0.f);
      keypoint.response = static_cast<float>(point.score);
    }
  });
  return features;
}

}  // namespace vantage::features
