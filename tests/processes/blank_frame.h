// A frame on which there is nothing to see.
#pragma once

#include "rgbd/frame.h"

namespace vantage::testing {

inline rgbd::Frame BlankFrame(std::int64_t utime, int width = 64, int height = 48) {
  rgbd::Frame frame;
  frame.utime = utime;
  frame.color = cv::Mat(height, width, CV_8UC3, cv::Scalar(90, 90, 90));
  frame.depth = cv::Mat::zeros(height, width, CV_16UC1);
  const double focal_px = width;
  frame.camera = {width, height, focal_px, focal_px, 0.5 * (width - 1), 0.5 * (height - 1)};
  return frame;
}

}  // namespace vantage::testing
