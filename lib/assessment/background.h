// Backgrounds for virtual views from the run's own frames.
#pragma once

#include <opencv2/core.hpp>

namespace vantage::assessment {

// The image with the masked part (CV_8UC1, non-zero = object, grown by a few pixels) filled in from its surroundings, so that no
// real object is left in it. Both of one size. Cost: about 20 ms for 640 x 480.
cv::Mat MaskedBackground(const cv::Mat& color, const cv::Mat& mask);

}  // namespace vantage::assessment
