// Pictures of what was recognised.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "recognition/recogniser.h"

namespace vantage::cli {

// The frame's picture with the convex hull of every detection's matched interest points laid over it (Figure 4 of the paper), its
// object's name and p(o|c). Every object has a colour of its own.
cv::Mat DrawDetections(const rgbd::Frame& frame, const std::vector<recognition::Detection>& detections);

// Throws std::runtime_error where the file cannot be written.
void WritePicture(const std::string& file, const cv::Mat& picture);

}  // namespace vantage::cli
