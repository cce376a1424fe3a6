// SURF (Bay, Tuytelaars and Van Gool, 2006) by dlib: what Extract does for the type "surf".
#pragma once

#include "features/features.h"

namespace vantage::features {

// Points of the image, strongest first, not more than params.max_keypoints. `mask` may be empty, else as large as the image. Points
// whose surroundings (16 times their scale) leave the image are not found. 64 values a descriptor. Describing uses all cores; the
// result is the same on one.
Features ExtractSurf(const cv::Mat& gray, const cv::Mat& mask, const FeatureParams& params);

}  // namespace vantage::features
