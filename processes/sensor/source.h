// Where a sensor's frames come from.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "rgbd/bop.h"
#include "rgbd/calibration.h"
#include "simulation/world.h"

namespace vantage::sensor {

class FrameSource {
 public:
  virtual ~FrameSource() = default;

  // The next frame; utime 0: captured now, as far as the source knows. `T_world_camera`: where the mount says the camera is.
  // nullopt: no more frames, or (see Ended) none just now. Throws std::runtime_error naming the source: a file that cannot be read,
  // a device that is gone.
  virtual std::optional<rgbd::Frame> Next(const std::optional<geometry::Rigid>& T_world_camera) = 0;
  virtual bool Ended() const { return false; }
  virtual bool Waiting() const { return false; }  // For a device that is not there now.
  virtual std::string Name() const = 0;           // For people.
};

// The frames of a BOP scene folder in order, with the recording's own camera poses. `frames`: "all", "even", "odd" or "A:B".
// Throws std::runtime_error / std::invalid_argument as BopScene and SelectFrames do, or where no frame is selected.
std::unique_ptr<FrameSource> MakeRecordingSource(const std::filesystem::path& folder, const std::string& frames, bool loop);

struct OpenNiOptions {
  std::string uri;  // A device, an .oni file; empty: the first device found.
  bool loop = false;
  int width = 0, height = 0, fps = 0;  // The mode wanted; 0: the device's own.
  std::optional<rgbd::CameraCalibration> calibration;
  std::string record;  // .oni file; empty: none. After a replug the next is NAME-2.oni.
  bool record_lossless = false;
  double max_silence_s = 3.0;  // A device silent for so long is closed and opened anew; >= 0.1.
};

// An OpenNI2 device or .oni recording. A device that is unplugged, or silent for max_silence_s, is looked for once a second, also
// at other ports, and goes on; meanwhile Waiting(). Throws std::runtime_error as OpenNiSource does: at first its device must be
// there; std::invalid_argument for max_silence_s.
std::unique_ptr<FrameSource> MakeOpenNiSource(const OpenNiOptions& options);

// What the camera on the mount sees in a world; from the start pose until the mount says where it is.
std::unique_ptr<FrameSource> MakeWorldSource(std::shared_ptr<const simulation::World> world, std::uint32_t seed);

}  // namespace vantage::sensor
