// Where a sensor's frames come from.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "rgbd/bop.h"
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
  virtual std::string Name() const = 0;  // For people.
};

// The frames of a BOP scene folder in order, with the recording's own camera poses. `frames`: "all", "even", "odd" or "A:B".
// Throws std::runtime_error / std::invalid_argument as BopScene and SelectFrames do, or where no frame is selected.
std::unique_ptr<FrameSource> MakeRecordingSource(const std::filesystem::path& folder, const std::string& frames, bool loop);

// An OpenNI2 device (`uri` empty: the first one) or .oni recording. Throws std::runtime_error as OpenNiSource does.
std::unique_ptr<FrameSource> MakeOpenNiSource(const std::string& uri, bool loop);

// What the camera on the mount sees in a world; from the start pose until the mount says where it is.
std::unique_ptr<FrameSource> MakeWorldSource(std::shared_ptr<const simulation::World> world, std::uint32_t seed);

}  // namespace vantage::sensor
