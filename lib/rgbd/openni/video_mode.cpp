#include "rgbd/openni/video_mode.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <opencv2/imgproc.hpp>
#include <tuple>

namespace vantage::rgbd {
namespace {

struct Format {
  openni::PixelFormat format;
  const char* name;
};
// Those that say most first.
constexpr std::array<Format, 6> kFormats{{{openni::PIXEL_FORMAT_RGB888, "RGB888"},
                                          {openni::PIXEL_FORMAT_YUV422, "YUV422"},
                                          {openni::PIXEL_FORMAT_YUYV, "YUYV"},
                                          {openni::PIXEL_FORMAT_GRAY8, "GRAY8"},
                                          {openni::PIXEL_FORMAT_DEPTH_100_UM, "0.1 mm"},
                                          {openni::PIXEL_FORMAT_DEPTH_1_MM, "1 mm"}}};

// Place in kFormats; its size where it is not there.
std::size_t Rank(openni::PixelFormat format) {
  const auto found = std::find_if(kFormats.begin(), kFormats.end(), [format](const Format& f) { return f.format == format; });
  return static_cast<std::size_t>(found - kFormats.begin());
}

bool Usable(const openni::VideoMode& mode) { return Rank(mode.getPixelFormat()) < kFormats.size(); }

cv::Mat Wrap(const openni::VideoFrameRef& frame, int type) {
  return {frame.getHeight(), frame.getWidth(), type, const_cast<void*>(frame.getData()),
          static_cast<std::size_t>(frame.getStrideInBytes())};
}

}  // namespace

std::string Describe(const openni::VideoMode& mode) {
  const std::size_t rank = Rank(mode.getPixelFormat());
  const std::string format = rank < kFormats.size() ? kFormats[rank].name : "format " + std::to_string(mode.getPixelFormat());
  return std::to_string(mode.getResolutionX()) + "x" + std::to_string(mode.getResolutionY()) + " " + format + " at " +
         std::to_string(mode.getFps()) + " Hz";
}

std::string DescribeAll(const openni::SensorInfo& sensor) {
  const auto& modes = sensor.getSupportedVideoModes();
  std::string text;
  for (int i = 0; i < modes.getSize(); ++i) {
    if (Usable(modes[i])) text += (text.empty() ? "" : ", ") + Describe(modes[i]);
  }
  return text.empty() ? "none that can be used" : text;
}

std::optional<openni::VideoMode> ChooseMode(const openni::SensorInfo& sensor, const openni::VideoMode& current,
                                            const WantedMode& wanted) {
  const int width = wanted.width > 0 ? wanted.width : current.getResolutionX();
  const int height = wanted.height > 0 ? wanted.height : current.getResolutionY();
  const int fps = wanted.fps > 0 ? wanted.fps : current.getFps();
  const auto& modes = sensor.getSupportedVideoModes();
  std::optional<openni::VideoMode> best;
  std::tuple<int, std::size_t> best_cost;
  for (int i = 0; i < modes.getSize(); ++i) {
    const openni::VideoMode& mode = modes[i];
    if (!Usable(mode) || mode.getResolutionX() != width || mode.getResolutionY() != height) continue;
    if (wanted.fps > 0 && mode.getFps() != fps) continue;
    const std::tuple<int, std::size_t> cost{std::abs(mode.getFps() - fps), Rank(mode.getPixelFormat())};
    if (best && cost >= best_cost) continue;
    best = mode;
    best_cost = cost;
  }
  return best;
}

std::optional<openni::VideoMode> ChooseDepthMode(const openni::SensorInfo& sensor, const openni::VideoMode& current,
                                                 int color_width, int color_height, int fps) {
  if (auto same = ChooseMode(sensor, current, {color_width, color_height, fps})) return same;
  const auto& modes = sensor.getSupportedVideoModes();
  int width = 0;
  for (int i = 0; i < modes.getSize(); ++i) {
    const int across = modes[i].getResolutionX(), down = modes[i].getResolutionY();
    if (across * color_height == down * color_width && Usable(modes[i])) width = std::max(width, across);
  }
  if (width == 0) return std::nullopt;
  return ChooseMode(sensor, current, {width, width * color_height / color_width, fps});
}

cv::Mat Convert(const openni::VideoFrameRef& frame) {
  cv::Mat image;
  switch (frame.getVideoMode().getPixelFormat()) {
    case openni::PIXEL_FORMAT_RGB888:
      cv::cvtColor(Wrap(frame, CV_8UC3), image, cv::COLOR_RGB2BGR);
      break;
    case openni::PIXEL_FORMAT_YUV422:
      cv::cvtColor(Wrap(frame, CV_8UC2), image, cv::COLOR_YUV2BGR_UYVY);
      break;
    case openni::PIXEL_FORMAT_YUYV:
      cv::cvtColor(Wrap(frame, CV_8UC2), image, cv::COLOR_YUV2BGR_YUYV);
      break;
    case openni::PIXEL_FORMAT_GRAY8:
      cv::cvtColor(Wrap(frame, CV_8UC1), image, cv::COLOR_GRAY2BGR);
      break;
    case openni::PIXEL_FORMAT_DEPTH_1_MM:
      image = Wrap(frame, CV_16UC1).clone();
      break;
    case openni::PIXEL_FORMAT_DEPTH_100_UM:
      Wrap(frame, CV_16UC1).convertTo(image, CV_16UC1, 0.1);
      break;
    default:
      break;
  }
  return image;
}

}  // namespace vantage::rgbd
