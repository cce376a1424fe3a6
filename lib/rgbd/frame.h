// One registered RGB-D frame and what can be read off it.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "geometry/camera.h"
#include "geometry/rigid.h"

namespace vantage::rgbd {

struct Frame {
  std::int64_t utime = 0;  // Capture time, microseconds since the epoch (recordings without times: id * 33333).
  std::int64_t id = 0;     // Frame number of the source (sequence number or the recording's own id).
  cv::Mat color;           // CV_8UC3, BGR.
  cv::Mat depth;           // CV_16UC1, millimetres along z, 0 = none; registered to and as large as colour; empty = no depth.
  geometry::PinholeCamera camera;
  std::optional<geometry::Rigid> T_world_camera;  // Where the recording or the mount knows it.
};

// The colour image as CV_8UC1.
cv::Mat Gray(const Frame& frame);

// Depth at a pixel (rounded), metres; where it is missing there, the median of the measured ones at most `radius_px` away (fine
// grids of holes). nullopt where there is none, the pixel is outside or the frame has no depth.
std::optional<double> DepthAt(const Frame& frame, const Eigen::Vector2d& pixel, int radius_px = 2);

// Surface point under a pixel, camera coordinates, metres.
std::optional<Eigen::Vector3d> PointAt(const Frame& frame, const Eigen::Vector2d& pixel, int radius_px = 2);

// Unit surface normal under a pixel from the depth around it, camera coordinates, facing the camera. nullopt at depth edges and
// where fewer than half of the neighbours were measured.
std::optional<Eigen::Vector3d> NormalAt(const Frame& frame, const Eigen::Vector2d& pixel, int radius_px = 4);

// The organised cloud: every pixel's point in camera coordinates, metres, CV_32FC3; NaN where there is no depth.
cv::Mat OrganisedCloud(const Frame& frame);

// Throws std::invalid_argument saying what was expected and found: colour not CV_8UC3, depth of another type or size, an intrinsic
// out of range, an image size that is not the camera's.
void CheckFrame(const Frame& frame);

}  // namespace vantage::rgbd
