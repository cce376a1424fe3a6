#include "rgbd/calibration.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>

namespace vantage::rgbd {

void CameraCalibration::Check() const {
  camera.Check();
  for (std::size_t i = 0; i < distortion.size(); ++i) {
    if (!(std::abs(distortion[i]) <= 10.0)) {
      throw std::invalid_argument("distortion[" + std::to_string(i) + "] must be in [-10, 10], is " +
                                  std::to_string(distortion[i]));
    }
  }
}

bool CameraCalibration::distorted() const {
  return std::any_of(distortion.begin(), distortion.end(), [](double k) { return k != 0.0; });
}

Undistorter::Undistorter(const CameraCalibration& calibration) : calibration_(calibration) {
  calibration_.Check();
  if (!calibration_.distorted()) return;
  const auto& camera = calibration_.camera;
  const cv::Matx33d K(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
  const cv::Mat k(1, 5, CV_64F, calibration_.distortion.data());
  cv::initUndistortRectifyMap(K, k, cv::noArray(), K, {camera.width, camera.height}, CV_32FC1, map_x_, map_y_);
}

void Undistorter::Undistort(Frame& frame) const {
  const auto& camera = calibration_.camera;
  for (const cv::Mat* image : {&frame.color, &frame.depth}) {
    if (image->empty() || image->size() == cv::Size(camera.width, camera.height)) continue;
    throw std::invalid_argument("expected images of " + std::to_string(camera.width) + "x" + std::to_string(camera.height) +
                                " as calibrated, found " + std::to_string(image->cols) + "x" + std::to_string(image->rows));
  }
  frame.camera = camera;
  if (map_x_.empty()) return;
  cv::Mat color, depth;
  cv::remap(frame.color, color, map_x_, map_y_, cv::INTER_LINEAR, cv::BORDER_CONSTANT);
  frame.color = color;
  if (frame.depth.empty()) return;
  cv::remap(frame.depth, depth, map_x_, map_y_, cv::INTER_NEAREST, cv::BORDER_CONSTANT);
  frame.depth = depth;
}

}  // namespace vantage::rgbd
