#include "vantage/overlay.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace vantage::cli {
namespace {

// Bright colours, one per object: a turn by the golden angle from each to the next, so that even many are told apart.
std::map<std::string, cv::Scalar> ColorsOf(const std::vector<recognition::Detection>& detections) {
  std::map<std::string, cv::Scalar> colors;
  for (const recognition::Detection& detection : detections) colors[detection.object] = cv::Scalar();
  double turn = 0.0;
  for (auto& [name, color] : colors) {
    const cv::Mat hsv(1, 1, CV_8UC3, cv::Scalar(std::floor(180.0 * turn), 200, 255));
    cv::Mat bgr;
    cv::cvtColor(hsv, bgr, cv::COLOR_HSV2BGR);
    const cv::Vec3b pixel = bgr.at<cv::Vec3b>(0, 0);
    color = cv::Scalar(pixel[0], pixel[1], pixel[2]);
    turn = std::fmod(turn + 0.381966, 1.0);
  }
  return colors;
}

void PutLabel(const std::string& text, cv::Point centre, const cv::Scalar& color, cv::Mat* picture) {
  const double scale = picture->cols / 1600.0;
  const int font = cv::FONT_HERSHEY_SIMPLEX;
  const cv::Size size = cv::getTextSize(text, font, scale, 1, nullptr);
  centre -= cv::Point(size.width / 2, 0);
  centre.x = std::clamp(centre.x, 0, std::max(0, picture->cols - size.width));
  cv::putText(*picture, text, centre, font, scale, cv::Scalar(0, 0, 0), 3, cv::LINE_AA);
  cv::putText(*picture, text, centre, font, scale, color, 1, cv::LINE_AA);
}

}  // namespace

cv::Mat DrawDetections(const rgbd::Frame& frame, const std::vector<recognition::Detection>& detections) {
  const std::map<std::string, cv::Scalar> colors = ColorsOf(detections);
  cv::Mat picture = frame.color.clone();
  std::vector<std::vector<cv::Point>> hulls;
  for (const recognition::Detection& detection : detections) {
    std::vector<cv::Point> pixels, hull;
    for (const Eigen::Vector2d& pixel : detection.inlier_pixels) pixels.emplace_back(cvRound(pixel.x()), cvRound(pixel.y()));
    if (!pixels.empty()) cv::convexHull(pixels, hull);
    hulls.push_back(std::move(hull));
  }
  cv::Mat filled = picture.clone();
  for (size_t i = 0; i < detections.size(); ++i) {
    if (hulls[i].size() >= 3) cv::fillConvexPoly(filled, hulls[i], colors.at(detections[i].object), cv::LINE_AA);
  }
  cv::addWeighted(filled, 0.35, picture, 0.65, 0.0, picture);
  for (size_t i = 0; i < detections.size(); ++i) {
    const recognition::Detection& detection = detections[i];
    const cv::Scalar color = colors.at(detection.object);
    if (hulls[i].size() >= 2) cv::polylines(picture, hulls[i], true, color, 2, cv::LINE_AA);
    for (const Eigen::Vector2d& pixel : detection.inlier_pixels) {
      cv::circle(picture, {cvRound(pixel.x()), cvRound(pixel.y())}, 1, color, cv::FILLED, cv::LINE_AA);
    }
  }
  for (size_t i = 0; i < detections.size(); ++i) {
    if (hulls[i].empty()) continue;
    const cv::Rect box = cv::boundingRect(hulls[i]);
    char text[32];
    std::snprintf(text, sizeof text, " %.2f", detections[i].probability);
    PutLabel(detections[i].object + text, (box.tl() + box.br()) / 2, cv::Scalar(255, 255, 255), &picture);
  }
  return picture;
}

void WritePicture(const std::string& file, const cv::Mat& picture) {
  bool written = false;
  try {
    written = cv::imwrite(file, picture);
  } catch (const cv::Exception&) {  // An extension OpenCV does not know.
  }
  if (!written) throw std::runtime_error(file + ": cannot write the picture; is the folder there and the name an image's (.png)?");
}

}  // namespace vantage::cli
