// A short log of what a sensor and a mount would say, the same bytes on every run.
#pragma once

#include <memory>
#include <string>

#include "messaging/bus.h"
#include "messaging/channels.h"
#include "messaging/frame_link.h"
#include "messaging/log.h"
#include "messaging/mount_messages.h"
#include "simulation/simulated_world.h"

namespace vantage::testing {

inline constexpr std::int64_t kLogBegin_us = 1700000000000000;
inline constexpr std::int64_t kLogFrame_us = 100000;

// `frames` frames of config/worlds/table.yaml at 10 Hz. The camera stands for `stand` frames, then steps `step_deg` around the
// table's middle.
inline void WriteSimulatedLog(const std::string& file, int frames, int stand = 5, double step_deg = 9.0) {
  const auto params = simulation::LoadWorldParams(std::string(VANTAGE_SOURCE_DIR) + "/config/worlds/table.yaml");
  const simulation::SimulatedWorld world(params);
  messaging::LogWriter log(file);
  std::int64_t now_us = kLogBegin_us;
  messaging::Bus bus("memq://", [&] { return now_us; });
  bus.SetTap([&](const std::string& channel, const void* data, std::size_t size) { log.Write(now_us, channel, data, size); });
  messaging::FrameSender sender(bus);
  for (int i = 0; i < frames; ++i) {
    const double angle_rad = step_deg / 180.0 * M_PI * (i / stand);
    const auto turn = Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitZ());
    messaging::MountState state;
    state.T_world_mount = geometry::Rigid(turn) * world.StartPose();
    state.utime = now_us;
    bus.Publish(messaging::kMountState, messaging::ToMessage(state));
    rgbd::Frame frame = world.Look(state.T_world_camera(), static_cast<std::uint32_t>(i));
    frame.id = i;
    frame.utime = now_us;
    now_us += 20000;  // A sensor takes some time.
    sender.Send(frame);
    now_us += kLogFrame_us - 20000;
  }
  log.Close();
}

}  // namespace vantage::testing
