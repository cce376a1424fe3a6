#include "mount/node.h"

#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <vantage/operator_command_t.hpp>

#include "common/calibration_file.h"
#include "common/params.h"
#include "messaging/channels.h"

namespace vantage::mount {
namespace {

using messaging::MountState;

std::string Text(const char* format, double a, double b) {
  char text[160];
  std::snprintf(text, sizeof text, format, a, b);
  return text;
}

void ReadFile(const std::string& file, MountParams& params) {
  auto yaml = config::Mapping::Load(file);
  yaml.Get("start_eye_m", params.start_eye_m);
  yaml.Get("start_target_m", params.start_target_m);
  yaml.Get("camera_position_m", params.camera_position_m);
  yaml.Get("camera_rotation_rad", params.camera_rotation_rad);
  yaml.Get("tolerance", params.tolerance);
  yaml.Get("max_start_distance_m", params.max_start_distance_m);
  yaml.Get("max_start_angle_rad", params.max_start_angle_rad);
  yaml.Get("rate_hz", params.rate_hz);
  auto limits = yaml.Child("limits");
  limits.Get("max_speed_m_s", params.limits.max_speed_m_s);
  limits.Get("max_acceleration_m_s2", params.limits.max_acceleration_m_s2);
  limits.Get("max_turn_rate_rad_s", params.limits.max_turn_rate_rad_s);
  limits.Get("max_turn_acceleration_rad_s2", params.limits.max_turn_acceleration_rad_s2);
  limits.Finish();
  yaml.Finish();
  yaml.Check(params);
}

}  // namespace

void MountParams::Check() const {
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(what);
  };
  limits.Check();
  mount.Check();
  require(start_eye_m.allFinite() && start_target_m.allFinite() && start_eye_m != start_target_m,
          "start_eye_m and start_target_m must be different points");
  require(camera_position_m.allFinite() && camera_rotation_rad.allFinite(),
          "camera_position_m and camera_rotation_rad must be finite");
  require(tolerance >= 0.0, "tolerance must be >= 0");
  require(max_start_distance_m > 0.0, "max_start_distance_m must be > 0");
  require(max_start_angle_rad > 0.0, "max_start_angle_rad must be > 0");
  require(rate_hz >= 1.0 && rate_hz <= 1000.0, "rate_hz must be in [1, 1000]");
}

MountParams LoadMountParams(const std::string& file, const std::string& library_file) {
  MountParams params;
  params::LibraryParams library;
  if (!library_file.empty()) library = params::LoadLibraryParams(library_file);
  params.mount = library.mount;
  if (!file.empty()) ReadFile(file, params);
  if (!library.hand_eye.empty()) {
    const auto seat = processes::LoadHandEye(library.hand_eye);
    params.camera_position_m = seat.T_mount_camera.translation();
    params.camera_rotation_rad = seat.RotationVector_rad();
  }
  return params;
}

std::string WhyRefused(const motion::Trajectory& trajectory, const geometry::Rigid& T_world_mount, const MountParams& params) {
  if (trajectory.waypoints.empty()) return "no waypoints";
  const auto jump = geometry::Difference(T_world_mount, trajectory.waypoints.front().T_world_mount);
  if (jump.translation_m > params.max_start_distance_m) {
    return Text("starts %.3f m from where the mount is; at most %.3f m", jump.translation_m, params.max_start_distance_m);
  }
  if (jump.rotation_rad > params.max_start_angle_rad) {
    return Text("starts turned by %.3f rad from how the mount is; at most %.3f rad", jump.rotation_rad, params.max_start_angle_rad);
  }
  for (std::size_t i = 1; i < trajectory.waypoints.size(); ++i) {
    const auto& from = trajectory.waypoints[i - 1];
    const auto& to = trajectory.waypoints[i];
    const auto step = geometry::Difference(from.T_world_mount, to.T_world_mount);
    const double time_s = to.time_s - from.time_s;
    const double speed_m_s = step.translation_m / time_s;
    const double turn_rad_s = step.rotation_rad / time_s;
    if (speed_m_s > params.limits.max_speed_m_s * (1.0 + params.tolerance)) {
      return Text("moves at %.3f m/s; at most %.3f m/s", speed_m_s, params.limits.max_speed_m_s);
    }
    if (turn_rad_s > params.limits.max_turn_rate_rad_s * (1.0 + params.tolerance)) {
      return Text("turns at %.3f rad/s; at most %.3f rad/s", turn_rad_s, params.limits.max_turn_rate_rad_s);
    }
  }
  return "";
}

MountNode::MountNode(messaging::Bus& bus, const MountParams& params)
    : Node(bus, "mount"), params_((params.Check(), params)), mounts_(params.mount) {
  const bool is_arm = params_.mount.type == "arm";
  const auto& arm = params_.mount.arm;
  state_.T_mount_camera = is_arm ? motion::CameraOnMount(arm.camera_position_m, arm.camera_rotation_rad)
                                 : motion::CameraOnMount(params_.camera_position_m, params_.camera_rotation_rad);
  geometry::Rigid T_world_camera = geometry::LookAt(params_.start_eye_m, params_.start_target_m, Eigen::Vector3d::UnitZ());
  if (is_arm) {
    const auto stance = mounts_.Make({})->StanceAt(T_world_camera);
    if (!stance) throw std::invalid_argument("the arm cannot reach from start_eye_m to look at start_target_m");
    T_world_camera = stance->T_world_camera;
    state_.joints_rad = stance->joints_rad;
  }
  state_.T_world_mount = T_world_camera * state_.T_mount_camera.inverse();
  Subscribe<mount_command_t>(messaging::kMountCommand, [this](const mount_command_t& message) { OnCommand(message); });
  Subscribe<operator_command_t>(messaging::kOperatorCommand, [this](const operator_command_t& message) {
    if (message.command == "stop" && (message.process.empty() || message.process == process())) Stop();
  });
}

std::string MountNode::State() const {
  switch (state_.result) {
    case MountState::Result::kIdle:
      return "idle";
    case MountState::Result::kExecuting:
      return "moving";
    case MountState::Result::kArrived:
      return "arrived";
    case MountState::Result::kRefused:
      return "refused";
    case MountState::Result::kStopped:
      return "stopped";
  }
  return "";
}

void MountNode::OnCommand(const mount_command_t& message) {
  if (message.command_id == state_.command_id) return;  // Sent again by someone who had not heard from us yet.
  const auto trajectory = messaging::FromMessage(message);
  Advance();
  std::string refusal;
  if (!trajectory) {
    refusal = trajectory.error;
    Refuse(messaging::kMountCommand, refusal);
  } else if (trajectory->waypoints.empty()) {
    state_.command_id = message.command_id;
    return Stop();
  } else if (driving_) {
    refusal = "command " + std::to_string(state_.command_id) + " is being driven; send one without waypoints to stop it";
  } else {
    refusal = state_.joints_rad.size() > 0
                  ? mounts_.WhyNotDriven(*trajectory, state_.joints_rad, params_.max_start_angle_rad, params_.tolerance)
                  : WhyRefused(*trajectory, state_.T_world_mount, params_);
  }

  next_publish_us_ = 0;
  if (driving_) return NoteError(refusal);  // What is under way goes on, under its own number.
  state_.command_id = message.command_id;
  state_.refusal = refusal;
  if (!refusal.empty()) {
    Count("refused");
    state_.result = MountState::Result::kRefused;
    return;
  }
  Count("commands");
  driving_ = *trajectory;
  driving_since_us_ = now_us();
  state_.moving = true;
  state_.result = MountState::Result::kExecuting;
}

void MountNode::Stop() {
  Advance();
  driving_.reset();
  state_.moving = false;
  state_.result = MountState::Result::kStopped;
  next_publish_us_ = 0;
}

void MountNode::Advance() {
  state_.utime = now_us();
  if (!driving_) return;
  const double time_s = 1e-6 * static_cast<double>(state_.utime - driving_since_us_);
  const motion::Waypoint now = driving_->Sample(time_s);
  state_.T_world_mount = now.T_world_mount;
  if (state_.joints_rad.size() > 0) state_.joints_rad = now.joints_rad;
  if (time_s < driving_->duration_s()) return;
  driving_.reset();
  state_.moving = false;
  state_.result = MountState::Result::kArrived;
  next_publish_us_ = 0;
}

void MountNode::Step() {
  Advance();
  if (state_.utime < next_publish_us_) return;
  bus_.Publish(messaging::kMountState, messaging::ToMessage(state_));
  Count("states");
  const auto period_us = static_cast<std::int64_t>(1e6 / params_.rate_hz);
  next_publish_us_ = next_publish_us_ + period_us > state_.utime ? next_publish_us_ + period_us : state_.utime + period_us;
}

}  // namespace vantage::mount
