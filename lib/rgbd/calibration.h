// A camera as calibrated: intrinsics with the lens's distortion, and images made free of it.
#pragma once

#include <array>
#include <opencv2/core.hpp>

#include "rgbd/frame.h"

namespace vantage::rgbd {

struct CameraCalibration {
  geometry::PinholeCamera camera;      // Of the undistorted image, which is as large as the distorted one.
  std::array<double, 5> distortion{};  // k1, k2, p1, p2, k3 (Brown, 1966; OpenCV's order); all 0: none. Each in [-10, 10].

  void Check() const;  // Throws std::invalid_argument naming the field.
  bool distorted() const;
};

// Makes images of a distorting lens those of the pinhole camera. What the lens did not see is black, and without depth. To be
// applied once: an image that was undistorted before comes out bent the other way.
class Undistorter {
 public:
  explicit Undistorter(const CameraCalibration& calibration);  // Throws as Check does.

  // The frame with its images undistorted, and the calibrated camera. Depth is that of the nearest pixel: a mean over an edge would
  // be a surface that is not there. Throws std::invalid_argument where the images are not as large as was calibrated. About 4 ms
  // for 640 x 480.
  void Undistort(Frame& frame) const;

 private:
  CameraCalibration calibration_;
  cv::Mat map_x_;  // For every undistorted pixel where it is in the distorted image.
  cv::Mat map_y_;
};

}  // namespace vantage::rgbd
