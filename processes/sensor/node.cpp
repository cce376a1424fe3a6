#include "sensor/node.h"

#include <algorithm>
#include <stdexcept>
#include <vantage/operator_command_t.hpp>

#include "messaging/channels.h"
#include "messaging/mount_messages.h"

namespace vantage::sensor {

void SensorNodeParams::Check() const {
  if (!(rate_hz > 0.0 && rate_hz <= 120.0)) throw std::invalid_argument("rate_hz must be in (0, 120]");
  if (!(start_delay_s >= 0.0)) throw std::invalid_argument("start_delay_s must be >= 0");
  sender.Check();
}

SensorNodeParams LoadSensorNodeParams(const std::string& file) {
  SensorNodeParams params;
  if (file.empty()) return params;
  auto yaml = config::Mapping::Load(file);
  yaml.Get("rate_hz", params.rate_hz);
  yaml.Get("start_delay_s", params.start_delay_s);
  auto sender = yaml.Child("sender");
  sender.Get("jpeg_quality", params.sender.jpeg_quality);
  sender.Get("max_part_bytes", params.sender.max_part_bytes);
  sender.Get("pace_us", params.sender.pace_us);
  sender.Get("raw", params.sender.raw);
  sender.Finish();
  yaml.Finish();
  yaml.Check(params);
  return params;
}

SensorNode::SensorNode(messaging::Bus& bus, std::unique_ptr<FrameSource> source, const SensorNodeParams& params)
    : Node(bus, "sensor"), params_(params), source_(std::move(source)), sender_(bus, params.sender) {
  params_.Check();
  next_frame_us_ = now_us() + static_cast<std::int64_t>(params_.start_delay_s * 1e6);
  SubscribeInOrder<mount_state_t>(messaging::kMountState, [this](const mount_state_t& message) {
    const auto state = messaging::FromMessage(message);
    if (!state) return Refuse(messaging::kMountState, state.error);
    T_world_camera_ = state->T_world_camera();
  });
  Subscribe<operator_command_t>(messaging::kOperatorCommand, [this](const operator_command_t& message) {
    if (!message.process.empty() && message.process != process()) return;
    if (message.command == "pause") paused_ = true;
    if (message.command == "resume") paused_ = false;
  });
}

void SensorNode::Step() {
  const std::int64_t now = now_us();
  if (now < next_frame_us_ || source_->Ended()) return;
  const auto period_us = static_cast<std::int64_t>(1e6 / params_.rate_hz);
  next_frame_us_ = std::max(next_frame_us_ + period_us, now);  // A slow source sends as fast as it can, never in bursts.
  if (paused_) return;
  auto frame = source_->Next(T_world_camera_);
  if (!frame) return;
  if (frame->utime == 0) frame->utime = now;
  sender_.Send(*frame);
  ++frames_;
  Count("frames");
}

}  // namespace vantage::sensor
