// Frames from an RGB-D camera or an .oni recording, through OpenNI2.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "rgbd/calibration.h"
#include "rgbd/frame.h"

namespace vantage::rgbd {

struct OpenNiParams {
  std::string uri;               // A device's URI or an .oni file; empty: the first device found.
  bool elsewhere = false;        // Where it is not at that URI, one of its kind at another port will do (the URI up to its '@').
  int width = 0;                 // Of the colour image, pixels; 0: the mode the device starts with. Depth takes the same size,
  int height = 0;                // or the largest of the same shape the device has. Both or none.
  int fps = 0;                   // Frames per second of both streams; 0: any.
  double speed = 0.0;            // Recordings: 1 is real time, 2 twice as fast; 0 as fast as frames are asked for; >= 0.
  bool repeat = false;           // Recordings: starts again at its end; times and frame numbers go on.
  int timeout_ms = 2000;         // Waits that long for a frame; > 0.
  std::int64_t start_utime = 0;  // Recordings: utime of time 0 of the recording. (Devices: their first frame is now.)
  // Instead of the intrinsics that the device tells (0 in many a recording); distortion is taken out of the images.
  std::optional<CameraCalibration> calibration;
  // Both streams are recorded in this .oni file as the device gives them, from the first frame to the end of the source's life;
  // empty: not. Colour as JPEG by OpenNI (a tenth of its size), or as it is; depth always as it is.
  std::string record;
  bool record_lossless = false;

  void Check() const;  // Throws std::invalid_argument naming the first field out of range.
};

// The device was unplugged: the source is of no more use.
class DeviceGone : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// One device or recording, both streams running. Colour and depth of a frame are those closest in time, at most half a frame apart;
// what has no partner is left out. Mirrored images are turned back. Depth is registered to colour and the streams kept in step
// where the device can do it (`registered`, `in_step` tell); a recording is as it was made. Intrinsics come from the calibration,
// else the colour stream's field of view, where that is 0 from the depth stream's. Not thread-safe.
class OpenNiSource {
 public:
  // Throws std::runtime_error saying what to do: no such file, no recording, no device, a device that may not be opened, a stream
  // or mode that it does not have, no field of view known, a recording that exists already.
  explicit OpenNiSource(const OpenNiParams& params);
  ~OpenNiSource();
  OpenNiSource(const OpenNiSource&) = delete;
  OpenNiSource& operator=(const OpenNiSource&) = delete;

  // The next frame; ids count from 0. nullopt at the end of a recording. Throws DeviceGone; std::runtime_error where no frame came
  // in time (it may be called again then) or a stream changed its format.
  std::optional<Frame> Next();

  const std::string& uri() const;  // Of what was opened.
  bool is_recording() const;
  int recorded_frames() const;  // Of the shorter stream; 0 for a device.
  bool registered() const;
  bool in_step() const;
  std::string modes() const;  // For people: "colour 640x480 RGB888 at 30 Hz, depth ...".
  const geometry::PinholeCamera& camera() const;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace vantage::rgbd
