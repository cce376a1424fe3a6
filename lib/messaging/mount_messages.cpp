#include "messaging/mount_messages.h"

#include <cmath>

#include "messaging/geometry_messages.h"

namespace vantage::messaging {
namespace {

constexpr double kMaxDuration_s = 3600.0;
constexpr double kMaxJoint_rad = 100.0;

std::vector<double> ToList(const Eigen::VectorXd& joints_rad) { return {joints_rad.data(), joints_rad.data() + joints_rad.size()}; }

Result<Eigen::VectorXd> ToJoints(const std::vector<double>& joints_rad) {
  using Joints = Result<Eigen::VectorXd>;
  if (joints_rad.size() > kMaxJoints) return Joints::Error(std::to_string(joints_rad.size()) + " joints are too many");
  const Eigen::VectorXd joints = Eigen::Map<const Eigen::VectorXd>(joints_rad.data(), static_cast<Eigen::Index>(joints_rad.size()));
  if (!joints.allFinite() || (joints.size() > 0 && joints.cwiseAbs().maxCoeff() > kMaxJoint_rad)) {
    return Joints::Error("a joint is out of range");
  }
  return joints;
}

}  // namespace

mount_state_t ToMessage(const MountState& state) {
  mount_state_t message;
  message.utime = state.utime;
  message.T_world_mount = ToMessage(state.T_world_mount);
  message.T_mount_camera = ToMessage(state.T_mount_camera);
  message.joints_rad = ToList(state.joints_rad);
  message.joint_count = static_cast<std::int8_t>(message.joints_rad.size());
  message.moving = state.moving;
  message.command_id = state.command_id;
  message.result = static_cast<std::int8_t>(state.result);
  message.refusal = state.refusal;
  return message;
}

Result<MountState> FromMessage(const mount_state_t& message) {
  using State = Result<MountState>;
  const auto T_world_mount = FromMessage(message.T_world_mount);
  if (!T_world_mount) return State::Error("T_world_mount: " + T_world_mount.error);
  const auto T_mount_camera = FromMessage(message.T_mount_camera);
  if (!T_mount_camera) return State::Error("T_mount_camera: " + T_mount_camera.error);
  if (message.result < 0 || message.result > static_cast<int>(MountState::Result::kStopped)) {
    return State::Error("result " + std::to_string(message.result) + " is unknown");
  }
  const auto joints_rad = ToJoints(message.joints_rad);
  if (!joints_rad) return State::Error(joints_rad.error);
  MountState state;
  state.joints_rad = *joints_rad;
  state.utime = message.utime;
  state.T_world_mount = *T_world_mount;
  state.T_mount_camera = *T_mount_camera;
  state.moving = message.moving != 0;
  state.command_id = message.command_id;
  state.result = static_cast<MountState::Result>(message.result);
  state.refusal = message.refusal;
  return state;
}

mount_command_t ToMessage(const motion::Trajectory& trajectory, std::int64_t command_id, std::int64_t utime) {
  mount_command_t message;
  message.utime = utime;
  message.command_id = command_id;
  for (const auto& waypoint : trajectory.waypoints) {
    waypoint_t entry;
    entry.time_s = waypoint.time_s;
    entry.T_world_mount = ToMessage(waypoint.T_world_mount);
    entry.joints_rad = ToList(waypoint.joints_rad);
    entry.joint_count = static_cast<std::int8_t>(entry.joints_rad.size());
    message.waypoints.push_back(entry);
  }
  message.count = static_cast<std::int16_t>(message.waypoints.size());
  return message;
}

Result<motion::Trajectory> FromMessage(const mount_command_t& message) {
  using Path = Result<motion::Trajectory>;
  motion::Trajectory trajectory;
  double last_s = 0.0;
  for (const auto& entry : message.waypoints) {
    const bool first = trajectory.waypoints.empty();
    if (!std::isfinite(entry.time_s) || entry.time_s > kMaxDuration_s) return Path::Error("a waypoint's time is out of range");
    if (first ? entry.time_s != 0.0 : entry.time_s <= last_s) {
      return Path::Error("waypoint times must start at 0 and ascend");
    }
    const auto pose = FromMessage(entry.T_world_mount);
    if (!pose) return Path::Error("waypoint " + std::to_string(trajectory.waypoints.size()) + ": " + pose.error);
    const auto joints_rad = ToJoints(entry.joints_rad);
    if (!joints_rad) return Path::Error("waypoint " + std::to_string(trajectory.waypoints.size()) + ": " + joints_rad.error);
    if (!first && joints_rad->size() != trajectory.waypoints.front().joints_rad.size()) {
      return Path::Error("all waypoints must have equally many joints");
    }
    last_s = entry.time_s;
    trajectory.waypoints.push_back({entry.time_s, *pose, *joints_rad});
  }
  return trajectory;
}

}  // namespace vantage::messaging
