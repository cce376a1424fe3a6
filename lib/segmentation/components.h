// Connected components of an organised cloud on the image grid. Internal to segmentation.
#pragma once

#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>

#include "segmentation/clusters.h"

namespace vantage::segmentation {

// No depth; table and far things; object; where an object's surface bends inwards, so that another may begin.
enum PixelState : std::uint8_t { kUnknown = 0, kOther = 1, kAbove = 2, kCrease = 3 };

// How far apart in depth neighbouring pixels of one object may be: it grows as depth noise does.
constexpr float kJumpFloor_m2 = 0.25f;  // Nearer than half a metre depth noise no longer falls with its square.
inline float JumpAt(float z_m, const ClusterParams& params) {
  return static_cast<float>(params.max_jump_m) * std::max(kJumpFloor_m2, z_m * z_m);
}

// How many steps along `direction` it is to the next measured pixel; 0 where it is out of the image or farther than a hole that
// parts nothing.
inline int StepsToNext(const cv::Mat& states, const cv::Point& from, const cv::Point& direction, int bridge_px) {
  cv::Point at = from + direction;
  for (int step = 1; step <= bridge_px + 1; ++step, at += direction) {
    if (at.x < 0 || at.y < 0 || at.x >= states.cols || at.y >= states.rows) return 0;
    if (states.at<std::uint8_t>(at) != kUnknown) return step;
  }
  return 0;
}

// Whether pixels so many steps apart are on one surface: a slanted one may fall half as much again for every pixel of a hole.
inline bool OnOneSurface(float z_m, float other_z_m, int steps, const ClusterParams& params) {
  return std::abs(other_z_m - z_m) <= JumpAt(z_m, params) * (0.5f + 0.5f * static_cast<float>(steps));
}

// CV_8UC1 of PixelState by height above the plane: kUnknown, kOther or kAbove.
cv::Mat Classify(const cv::Mat& cloud, const Plane& plane, const ClusterParams& params);

// Labels 1 .. n of the connected kAbove pixels (CV_32SC1, 0 elsewhere), in the order of their first pixels. A pixel is joined with
// the next one to the right, below and along both diagonals: across holes up to bridge_px wide, not across a depth jump, and not
// across anything else that was measured.
int Components(const cv::Mat& states, const cv::Mat& cloud, const ClusterParams& params, cv::Mat* labels);

}  // namespace vantage::segmentation
