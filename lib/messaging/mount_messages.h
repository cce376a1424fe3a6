// The mount on the wire: trajectories out, poses back.
#pragma once

#include <cstdint>
#include <string>
#include <vantage/mount_command_t.hpp>
#include <vantage/mount_state_t.hpp>

#include "messaging/result.h"
#include "motion/trajectory.h"

namespace vantage::messaging {

inline constexpr int kMaxJoints = 16;

struct MountState {
  enum class Result { kIdle, kExecuting, kArrived, kRefused, kStopped };

  std::int64_t utime = 0;  // Microseconds since the epoch, when the pose was true.
  geometry::Rigid T_world_mount = geometry::Rigid::Identity();
  geometry::Rigid T_mount_camera = geometry::Rigid::Identity();
  Eigen::VectorXd joints_rad;  // Of an arm, from its base; at most kMaxJoints.
  bool moving = false;
  std::int64_t command_id = -1;  // Of the newest command heard; -1 = none.
  Result result = Result::kIdle;
  std::string refusal;

  geometry::Rigid T_world_camera() const { return T_world_mount * T_mount_camera; }
};

mount_state_t ToMessage(const MountState& state);
Result<MountState> FromMessage(const mount_state_t& message);

// An empty trajectory is the command to stop.
mount_command_t ToMessage(const motion::Trajectory& trajectory, std::int64_t command_id, std::int64_t utime);
// Refuses poses and joints out of range, joints that some waypoints have and others not, and times that do not start at 0, do not
// ascend or pass one hour.
Result<motion::Trajectory> FromMessage(const mount_command_t& message);

}  // namespace vantage::messaging
