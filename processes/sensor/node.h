// Publishes RGB-D frames from a source at a steady rate.
#pragma once

#include <memory>
#include <optional>

#include "config/yaml.h"
#include "messaging/frame_link.h"
#include "messaging/node.h"
#include "sensor/source.h"

namespace vantage::sensor {

struct SensorNodeParams {
  double rate_hz = 10.0;       // Frames per second at most; in (0, 120].
  double start_delay_s = 0.0;  // A recording waits so long before its first frame, so that listeners are there; >= 0.
  messaging::FrameSenderParams sender;

  void Check() const;  // Throws std::invalid_argument naming the field.
};

// Reads the fields of the YAML file; throws std::runtime_error "FILE:LINE: ...".
SensorNodeParams LoadSensorNodeParams(const std::string& file);

class SensorNode : public messaging::Node {
 public:
  SensorNode(messaging::Bus& bus, std::unique_ptr<FrameSource> source, const SensorNodeParams& params);

  void Step() override;
  std::int64_t NextStep_us() const override { return source_->Ended() ? kNever : next_frame_us_; }
  bool Finished() const override { return source_->Ended(); }
  std::int64_t frames() const { return frames_; }

 protected:
  std::string State() const override {
    return source_->Ended() ? "ended" : paused_ ? "paused" : source_->Waiting() ? "waiting" : "streaming";
  }
  std::string Detail() const override {
    return source_->Name() + (source_->Ended() ? ": ended after " + std::to_string(frames_) + " frames" : "");
  }

 private:
  SensorNodeParams params_;
  std::unique_ptr<FrameSource> source_;
  messaging::FrameSender sender_;
  std::optional<geometry::Rigid> T_world_camera_;
  std::int64_t next_frame_us_ = 0;
  std::int64_t frames_ = 0;
  bool paused_ = false;
};

}  // namespace vantage::sensor
