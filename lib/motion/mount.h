// What carries the camera, as the planner sees it: where it can go, along which path, how long that takes.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "motion/obstacles.h"
#include "motion/path_audit.h"
#include "motion/trajectory.h"

namespace vantage::motion {

// How a mount stands: where its camera is and, of an arm, the joints that hold it there.
struct Stance {
  Stance() = default;
  Stance(const geometry::Rigid& pose, Eigen::VectorXd joints = {})  // A pose alone is a stance without joints.
      : T_world_camera(pose), joints_rad(std::move(joints)) {}

  geometry::Rigid T_world_camera = geometry::Rigid::Identity();
  Eigen::VectorXd joints_rad;  // From the base; empty for a mount without joints.
};

// A path to one goal, or why there is none.
struct PathResult {
  std::optional<Trajectory> trajectory;  // Collision-free and timed; its poses are the camera's.
  std::string refusal;  // Why there is none: "in collision", "out of the workspace", "out of reach", "no path found"; all but the
                        // last with "start " before them where it is the start that is at fault. Empty where there is a trajectory.
};

class Mount {
 public:
  virtual ~Mount() = default;

  // Why the mount cannot put the camera there, in the words of PathResult; empty where it can (a path may still be missing). Cheap.
  virtual std::string WhyUnreachable(const geometry::Rigid& T_world_camera) const = 0;

  // Paths from `start` to every goal (same order), planned together on one roadmap. Deterministic: same seed, same paths.
  virtual std::vector<PathResult> Plan(const Stance& start, const std::vector<geometry::Rigid>& T_world_camera_goals,
                                       std::uint32_t seed) const = 0;

  // The same way made as short as it gets, for the path that will be driven: Plan may leave that out to be quick. As free of
  // collisions, never slower.
  virtual Trajectory Shortened(const Trajectory& path, std::uint32_t /*seed*/) const { return path; }

  // How the mount would stand there; nullopt where it cannot.
  virtual std::optional<Stance> StanceAt(const geometry::Rigid& T_world_camera) const {
    return WhyUnreachable(T_world_camera).empty() ? std::optional<Stance>(T_world_camera) : std::nullopt;
  }
};

struct FreeMountParams {
  double camera_radius_m = 0.06;  // Sphere around the camera that must stay clear; > 0.
  double clearance_m = 0.02;  // Kept from obstacles beyond that, as they are known to some accuracy only; >= 0. Where the start has
                              // less, paths keep as much as it has.
  Eigen::Vector3d workspace_lower_m{-1.5, -1.5, -0.5};  // World; the camera's origin stays inside.
  Eigen::Vector3d workspace_upper_m{1.5, 1.5, 2.0};
  int roadmap_samples = 400;  // PRM milestones beside start and goals; >= 0.
  SpeedLimits limits;

  void Check() const;  // Throws std::invalid_argument naming the field.
};

// A camera that flies freely (SE(3)). Goals in straight, free reach are flown to directly; for all others one PRM (OMPL) over
// positions is grown, and its shortest paths are shortened before they are timed. The body is a sphere, so orientation cannot
// collide: it is interpolated (slerp) by arc length. Corners rounded by the timing are checked again and flown exactly where
// rounding would touch. Obstacles are fixed for the life of the object. Throws what Check() and CollisionWorld throw.
// Cost: 150 goals on one core, table and 3 hulls, below 0.2 s.
std::unique_ptr<Mount> MakeFreeMount(const FreeMountParams& params, const Obstacles& obstacles);

// Where a camera sits on its mount, from what a configuration says: T_mount_camera of a camera at `position_m`, turned by
// `rotation_rad` (axis times angle), both in the mount's axes.
geometry::Rigid CameraOnMount(const Eigen::Vector3d& position_m, const Eigen::Vector3d& rotation_rad);

struct ArmMountParams {
  std::string urdf;  // File; a serial arm of revolute joints with limits, collision shapes: boxes, cylinders, spheres.
  Eigen::Vector3d base_position_m{-0.25, 0.0, 1.5};    // World; of the URDF's root link.
  double base_yaw_rad = 0.0;                           // About the world's z...
  double base_roll_rad = 3.141592653589793;            // ...after this about its x: pi hangs it over the table.
  Eigen::Vector3d camera_position_m{0.0, 0.0, 0.06};   // Of the camera on the last link (T_mount_camera); axes are the link's.
  Eigen::Vector3d camera_rotation_rad{0.0, 0.0, 0.0};  // How it is turned there: axis times angle, in the link's axes.
  double clearance_m = 0.02;                           // Kept from obstacles and between links; > 0.008.
  double max_acceleration_rad_s2 = 1.6;                // Of every joint; > 0. Speeds are the URDF's.
  int ik_seeds = 12;                                   // Starts of the inverse kinematics for a pose; >= 1.
  int ik_solutions = 3;                                // Different ones kept of a pose; >= 1.
  int roadmap_samples = 200;                           // PRM milestones beside start and goals; >= 0.

  void Check() const;  // Throws std::invalid_argument naming the field. An empty urdf passes: see MountParams.
};

// Which mount there is, as configured.
struct MountParams {
  std::string type = "free";  // "free" or "arm".
  FreeMountParams free;
  ArmMountParams arm;  // Needs arm.urdf where it is the type.

  void Check() const;  // Throws std::invalid_argument naming the field.
};

struct ArmModel;

// Makes the configured mount among the obstacles of the moment; what stays the same (the arm's model) is read once.
class MountMaker {
 public:
  // Throws what params.Check() throws, and std::runtime_error where the URDF cannot be read or is no such arm.
  explicit MountMaker(const MountParams& params);

  // Throws std::invalid_argument as CollisionWorld does.
  std::unique_ptr<Mount> Make(const Obstacles& obstacles) const;
  BodyAt Body() const;  // For AuditPath.

  // Why an arm cannot drive this, whatever stands around: joints missing, starting elsewhere than `joints_rad` by more than
  // `max_start_rad`, out of their range, or faster than they may by more than the share `tolerance`. Empty where it can, and for a
  // mount without joints.
  std::string WhyNotDriven(const Trajectory& path, const Eigen::VectorXd& joints_rad, double max_start_rad, double tolerance) const;

 private:
  MountParams params_;
  std::shared_ptr<const ArmModel> arm_;
};

}  // namespace vantage::motion
