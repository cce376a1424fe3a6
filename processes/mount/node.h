// The simulated mount: drives the camera along trajectories in real time, within its speed limits.
#pragma once

#include <optional>
#include <string>

#include "config/yaml.h"
#include "messaging/mount_messages.h"
#include "messaging/node.h"
#include "motion/mount.h"

namespace vantage::mount {

struct MountParams {
  Eigen::Vector3d start_eye_m{0.55, 0.0, 0.45};        // World; where the camera is at first...
  Eigen::Vector3d start_target_m{0.0, 0.0, 0.08};      // ...and what it looks at.
  Eigen::Vector3d camera_position_m{0.0, 0.0, 0.0};    // Of the camera on the mount (T_mount_camera); axes are the mount's.
  Eigen::Vector3d camera_rotation_rad{0.0, 0.0, 0.0};  // How it is turned there: axis times angle, in the mount's axes.
  motion::MountParams mount;           // Of the library: an arm has joints, and where its camera sits is said there.
  motion::SpeedLimits limits;          // A command that breaks them is refused.
  double tolerance = 0.1;              // ...by more than this share; >= 0.
  double max_start_distance_m = 0.02;  // A trajectory starts at most so far from where the mount is; > 0.
  double max_start_angle_rad = 0.05;   // Likewise; > 0.
  double rate_hz = 30.0;               // Of MOUNT_STATE; in [1, 1000].

  void Check() const;  // Throws std::invalid_argument naming the field.
};

// Reads the fields of the YAML file, and the library's mount from `library_file`; either may be empty. The library's hand_eye file
// counts before what either says of the camera. Throws std::runtime_error "FILE:LINE: ...".
MountParams LoadMountParams(const std::string& file, const std::string& library_file = "");

// Why this trajectory of a mount without joints must not be driven from here; empty where it may.
std::string WhyRefused(const motion::Trajectory& trajectory, const geometry::Rigid& T_world_mount, const MountParams& params);

class MountNode : public messaging::Node {
 public:
  MountNode(messaging::Bus& bus, const MountParams& params);

  void Step() override;
  std::int64_t NextStep_us() const override { return next_publish_us_; }
  const messaging::MountState& state() const { return state_; }

 protected:
  std::string State() const override;
  std::string Detail() const override { return state_.refusal; }

 private:
  void OnCommand(const mount_command_t& message);
  void Stop();
  void Advance();

  MountParams params_;
  motion::MountMaker mounts_;
  messaging::MountState state_;
  std::optional<motion::Trajectory> driving_;
  std::int64_t driving_since_us_ = 0;
  std::int64_t next_publish_us_ = 0;
};

}  // namespace vantage::mount
