// Frames from an RGB-D camera or an .oni recording, through OpenNI2.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "rgbd/frame.h"

namespace vantage::rgbd {

struct OpenNiParams {
  std::string uri;               // A device's URI or an .oni file; empty: the first device found.
  double speed = 0.0;            // Recordings: 1 is real time, 2 twice as fast; 0 as fast as frames are asked for; >= 0.
  bool repeat = false;           // Recordings: starts again at its end; times and frame numbers go on.
  int timeout_ms = 2000;         // Waits that long for a frame; > 0.
  std::int64_t start_utime = 0;  // Recordings: utime of time 0 of the recording. (Devices: their first frame is now.)
  std::optional<geometry::PinholeCamera> camera;  // Instead of the intrinsics that the device tells (0 in many a recording).

  void Check() const;  // Throws std::invalid_argument naming the first field out of range.
};

// One device or recording, both streams running. Colour and depth of a frame are those closest in time, at most half a frame apart;
// what has no partner is left out. Mirrored images are turned back. Depth is registered to colour where the device can do it
// (`registered` tells); a recording is as it was made. Intrinsics come from the colour stream's field of view, where that is 0 from
// the depth stream's. Not thread-safe.
class OpenNiSource {
 public:
  // Throws std::runtime_error saying what to do: no such file, no recording, no device, a stream missing, no field of view known.
  explicit OpenNiSource(const OpenNiParams& params);
  ~OpenNiSource();
  OpenNiSource(const OpenNiSource&) = delete;
  OpenNiSource& operator=(const OpenNiSource&) = delete;

  // The next frame; ids count from 0. nullopt at the end of a recording. Throws std::runtime_error where none came in time (it may
  // be called again then) or a stream changed its format.
  std::optional<Frame> Next();

  const std::string& uri() const;
  bool is_recording() const;
  int recorded_frames() const;  // Of the shorter stream; 0 for a device.
  bool registered() const;
  const geometry::PinholeCamera& camera() const;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace vantage::rgbd
