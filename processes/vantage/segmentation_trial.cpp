#include "vantage/segmentation_trial.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <opencv2/imgproc.hpp>

namespace vantage::cli {
namespace {

constexpr int kLabelsPerObject = 10;
constexpr int kFirstObject = 2;

int Common(const cv::Mat& a, const cv::Mat& b) { return cv::countNonZero(a & b); }

}  // namespace

std::vector<cv::Mat> TrueMasks(const cv::Mat& label) {
  std::vector<cv::Mat> masks;
  for (int object = kFirstObject; kLabelsPerObject * object < 256; ++object) {
    cv::Mat mask = (label >= kLabelsPerObject * object) & (label < kLabelsPerObject * (object + 1));
    if (cv::countNonZero(mask) >= kLeastTruePixels) masks.push_back(std::move(mask));
  }
  return masks;
}

std::vector<cv::Mat> PlainComponents(const rgbd::Frame& frame, const segmentation::Plane& plane, int min_pixels, double jump_m) {
  const cv::Mat cloud = rgbd::OrganisedCloud(frame);
  cv::Mat above(cloud.size(), CV_8UC1, cv::Scalar(0));
  for (int y = 0; y < cloud.rows; ++y) {
    for (int x = 0; x < cloud.cols; ++x) {
      const cv::Vec3f& p = cloud.at<cv::Vec3f>(y, x);
      above.at<std::uint8_t>(y, x) = !std::isnan(p[2]) && plane.Height({p[0], p[1], p[2]}) >= kPlainHeight_m;
    }
  }
  std::vector<cv::Mat> masks;
  std::vector<cv::Point> pixels;
  for (int y = 0; y < cloud.rows; ++y) {
    for (int x = 0; x < cloud.cols; ++x) {
      if (!above.at<std::uint8_t>(y, x)) continue;
      above.at<std::uint8_t>(y, x) = 0;
      pixels.assign(1, {x, y});
      for (std::size_t next = 0; next < pixels.size(); ++next) {
        const cv::Point from = pixels[next];
        const float z = cloud.at<cv::Vec3f>(from)[2];
        for (const cv::Point& step : {cv::Point(1, 0), cv::Point(-1, 0), cv::Point(0, 1), cv::Point(0, -1)}) {
          const cv::Point to = from + step;
          if (to.x < 0 || to.y < 0 || to.x >= cloud.cols || to.y >= cloud.rows || !above.at<std::uint8_t>(to)) continue;
          if (std::abs(cloud.at<cv::Vec3f>(to)[2] - z) > jump_m) continue;
          above.at<std::uint8_t>(to) = 0;
          pixels.push_back(to);
        }
      }
      if (static_cast<int>(pixels.size()) < min_pixels) continue;
      cv::Mat mask(cloud.size(), CV_8UC1, cv::Scalar(0));
      for (const cv::Point& pixel : pixels) mask.at<std::uint8_t>(pixel) = 255;
      masks.push_back(mask);
    }
  }
  return masks;
}

std::vector<ObjectScore> ScoreSegments(const std::vector<cv::Mat>& segments, const std::vector<cv::Mat>& truth) {
  std::vector<ObjectScore> scores;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const int size = cv::countNonZero(truth[i]);
    ObjectScore score;
    int most = 0;
    const cv::Mat* holder = nullptr;
    for (const cv::Mat& segment : segments) {
      const int common = Common(segment, truth[i]);
      score.iou = std::max(score.iou, common / static_cast<double>(size + cv::countNonZero(segment) - common));
      if (common > most) most = common, holder = &segment;
    }
    score.missing = 1.0 - most / static_cast<double>(size);
    for (std::size_t k = 0; holder && k < truth.size(); ++k)
      if (k != i) score.foreign += Common(*holder, truth[k]) / static_cast<double>(size);
    scores.push_back(score);
  }
  return scores;
}

void SegmentationFigures::Add(const std::vector<ObjectScore>& scores, int segments, double plane_ms, double segments_ms) {
  scores_.insert(scores_.end(), scores.begin(), scores.end());
  segments_ += segments;
  plane_ms_.push_back(plane_ms);
  segments_ms_.push_back(segments_ms);
}

int SegmentationFigures::found() const {
  return static_cast<int>(std::count_if(scores_.begin(), scores_.end(), [](const ObjectScore& s) { return s.iou >= kWholeIou; }));
}

double SegmentationFigures::MeanOf(double ObjectScore::*member) const {
  double sum = 0.0;
  for (const ObjectScore& score : scores_) sum += score.*member;
  return sum / static_cast<double>(scores_.size());
}

Json SegmentationFigures::ToJson() const {
  return {{"images", plane_ms_.size()},
          {"objects", objects()},
          {"found", found()},
          {"found_share", Number(found() / static_cast<double>(objects()))},
          {"iou_mean", Number(MeanOf(&ObjectScore::iou))},
          {"over_segmentation", Number(MeanOf(&ObjectScore::missing))},
          {"under_segmentation", Number(MeanOf(&ObjectScore::foreign))},
          {"segments", segments_},
          {"plane_ms_median", Number(Quantile(plane_ms_, 0.5))},
          {"segments_ms_median", Number(Quantile(segments_ms_, 0.5))}};
}

std::string SegmentationFigures::Header() {
  return "                            images  objects  found  mean IoU   over  under  segments  plane ms  segments ms\n";
}

std::string SegmentationFigures::Row(const std::string& name) const {
  char line[200];
  std::snprintf(line, sizeof line, "%-27s %6zu %8d %6d %9.3f %6.3f %6.3f %9d %9.1f %12.1f\n", name.c_str(), plane_ms_.size(),
                objects(), found(), MeanOf(&ObjectScore::iou), MeanOf(&ObjectScore::missing), MeanOf(&ObjectScore::foreign),
                segments_, Quantile(plane_ms_, 0.5), Quantile(segments_ms_, 0.5));
  return line;
}

cv::Mat DrawMasks(const cv::Mat& color, const std::vector<cv::Mat>& masks) {
  cv::Mat picture = color.clone();
  for (std::size_t i = 0; i < masks.size(); ++i) {
    // A turn of the hue by the golden angle from each to the next.
    const cv::Mat hsv(1, 1, CV_8UC3, cv::Scalar(std::floor(180.0 * std::fmod(0.381966 * static_cast<double>(i), 1.0)), 220, 255));
    cv::Mat bgr, tinted;
    cv::cvtColor(hsv, bgr, cv::COLOR_HSV2BGR);
    const cv::Scalar tint(bgr.at<cv::Vec3b>(0, 0));
    cv::addWeighted(picture, 0.5, cv::Mat(picture.size(), CV_8UC3, tint), 0.5, 0.0, tinted);
    tinted.copyTo(picture, masks[i]);
    std::vector<std::vector<cv::Point>> outlines;
    cv::findContours(masks[i], outlines, cv::RETR_LIST, cv::CHAIN_APPROX_NONE);
    cv::drawContours(picture, outlines, -1, tint, 1);
  }
  return picture;
}

}  // namespace vantage::cli
