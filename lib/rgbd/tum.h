// Recordings in the layout of the TUM RGB-D benchmark (Sturm et al., 2012): rgb.txt, depth.txt, groundtruth.txt.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "geometry/camera.h"
#include "geometry/rigid.h"

namespace vantage::rgbd {

inline constexpr double kTumDepthScale_mm = 0.2;  // A unit of the depth images: 5000 are a metre.

struct TumFrame {
  std::int64_t utime = 0;  // Of the colour image.
  std::filesystem::path color;
  std::filesystem::path depth;                    // At most 20 ms from colour; each is used once.
  std::optional<geometry::Rigid> T_world_camera;  // Between the two poses around utime, at most 0.1 s apart.
};

bool IsTumFolder(const std::filesystem::path& folder);

// The colour images that have a depth image, in order of time. Throws std::runtime_error naming file and line: a list is missing or
// broken, no pair.
std::vector<TumFrame> ReadTum(const std::filesystem::path& folder);

// Of calibration.txt ("fx fy cx cy") where there is one, else what the benchmark advises for images with registered depth. Width
// and height stay 0.
geometry::PinholeCamera ReadTumCamera(const std::filesystem::path& folder);

}  // namespace vantage::rgbd
