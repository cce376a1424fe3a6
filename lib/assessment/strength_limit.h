// Which interest points of a virtual image a whole image would have kept: in a photograph they compete with all of its background.
#pragma once

#include <map>
#include <opencv2/core.hpp>
#include <utility>

#include "assessment/virtual_object.h"
#include "features/features.h"

namespace vantage::assessment {

// Stands for the image a window was cut from. A whole image keeps FeatureParams::max_keypoints, the strongest; a window alone would
// keep weaker ones too. What blur and noise do to the limit is measured on the part of the image with the most interest points.
class StrengthLimit {
 public:
  // `kept`: what Extract finds in the image (CV_8UC3 BGR). `patch`: size of the part, cut to the image's.
  StrengthLimit(const cv::Mat& image, const features::Features& kept, const features::FeatureParams& params, const cv::Size& patch);

  // The least response that is kept in an image so disturbed; 0 where all are. Cost: interest points of the patch, the first time
  // for each blur and noise.
  double Response(const Disturbance& disturbance);

 private:
  double Measure(double blur_px, double image_noise) const;

  features::FeatureParams params_;
  cv::Mat patch_;
  int kept_in_patch_ = 0;  // As many as the patch has a share of the image's, where the image has max_keypoints.
  std::map<std::pair<double, double>, double> responses_;  // By blur and noise, at the image's own brightness.
};

// The image's points of at least this response: those that features::Extract finds less the weaker ones, which are not described
// first (a third of the time).
features::Features ExtractStrong(const cv::Mat& gray, const features::FeatureParams& params, double min_response);

}  // namespace vantage::assessment
