// Segmentation held against label images, beside the plain method that it has to beat.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "segmentation/clusters.h"
#include "vantage/verb.h"

namespace vantage::cli {

constexpr double kWholeIou = 0.9;      // An object is found as one cluster from this intersection over union on.
constexpr int kLeastTruePixels = 300;  // Smaller true masks are not judged.
constexpr double kPlainJump_m = 0.02;  // Depth cut-off of the plain method; `osd`'s even images are the same from 10 to 30 mm.
constexpr double kPlainHeight_m = 0.01;

// The true masks of a label image (CV_8UC1): 10 n .. 10 n + 9 is one object from n = 2 on; smaller ones are table and background.
std::vector<cv::Mat> TrueMasks(const cv::Mat& label);

// The plain method: 4-connected components of the measured pixels from 10 mm above the plane on, parted where neighbours differ by
// more than a fixed step in depth; no bridging of holes, no merging of parts. Masks (CV_8UC1, 255), those of fewer than
// `min_pixels` left out.
std::vector<cv::Mat> PlainComponents(const rgbd::Frame& frame, const segmentation::Plane& plane, int min_pixels,
                                     double jump_m = kPlainJump_m);

// How one true object was found.
struct ObjectScore {
  double iou = 0.0;      // With the segment that fits it best.
  double missing = 0.0;  // Share of the object outside the segment that holds most of it (over-segmentation).
  double foreign = 0.0;  // Pixels of other objects in that segment, over the object's (under-segmentation).
};
std::vector<ObjectScore> ScoreSegments(const std::vector<cv::Mat>& segments, const std::vector<cv::Mat>& truth);

// Of many images.
class SegmentationFigures {
 public:
  void Add(const std::vector<ObjectScore>& scores, int segments, double plane_ms, double segments_ms);
  int objects() const { return static_cast<int>(scores_.size()); }
  int found() const;
  Json ToJson() const;
  std::string Row(const std::string& name) const;  // Of the table; as Header.
  static std::string Header();

 private:
  double MeanOf(double ObjectScore::*member) const;
  std::vector<ObjectScore> scores_;
  int segments_ = 0;
  std::vector<double> plane_ms_, segments_ms_;
};

// The picture with every mask's outline and a tint of its own.
cv::Mat DrawMasks(const cv::Mat& color, const std::vector<cv::Mat>& masks);

}  // namespace vantage::cli
