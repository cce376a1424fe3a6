// Which modes of an OpenNI2 stream can be used, and its images in our formats.
#pragma once

#include <OpenNI.h>

#include <opencv2/core.hpp>
#include <optional>
#include <string>

namespace vantage::rgbd {

// "640x480 RGB888 at 30 Hz".
std::string Describe(const openni::VideoMode& mode);

// All modes of a sensor that can be used, for people.
std::string DescribeAll(const openni::SensorInfo& sensor);

// What is asked of a mode; 0: anything.
struct WantedMode {
  int width = 0;
  int height = 0;
  int fps = 0;
};

// The best mode of a sensor that is as wanted: in what is left open like `current`, of the formats that say most. nullopt where
// there is none.
std::optional<openni::VideoMode> ChooseMode(const openni::SensorInfo& sensor, const openni::VideoMode& current,
                                            const WantedMode& wanted);

// The mode for depth beside colour of this size: as large, else the largest of the same shape; fps as wanted. nullopt where there
// is none.
std::optional<openni::VideoMode> ChooseDepthMode(const openni::SensorInfo& sensor, const openni::VideoMode& current,
                                                 int color_width, int color_height, int fps);

// A copy of the image: BGR (CV_8UC3), or depth in millimetres (CV_16UC1). Empty for a format that is not supported.
cv::Mat Convert(const openni::VideoFrameRef& frame);

}  // namespace vantage::rgbd
