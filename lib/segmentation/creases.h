// Concave creases: where one object stands on another or touches it, the surface bends inwards sharply. Internal to segmentation.
#pragma once

#include <opencv2/core.hpp>
#include <set>
#include <utility>

#include "geometry/camera.h"
#include "segmentation/components.h"

namespace vantage::segmentation {

// By how much the surface bends inwards at each kAbove pixel, degrees (CV_32FC1): 180 less the angle between two arms laid onto it,
// the largest over four directions; 0 where it is flat or bends outwards, at jumps in depth, where depth noise drowns it and
// elsewhere.
cv::Mat InwardBend(const cv::Mat& states, const cv::Mat& cloud, const geometry::PinholeCamera& camera, const ClusterParams& params);

struct Surfaces {
  cv::Mat labels;  // As Components'.
  int count = 0;
  std::set<std::pair<int, int>> in_crease;  // Labels that meet in one, the lower first.
};

// Connected surfaces, parted where they meet in creases. Parts of small size, and those that meet in short or shallow creases, stay
// one (after the convexity criterion of Stein et al., 2014, on the image grid).
Surfaces PartAtCreases(const cv::Mat& states, const cv::Mat& cloud, const geometry::PinholeCamera& camera,
                       const ClusterParams& params);

}  // namespace vantage::segmentation
