// What carries the camera, as the planner sees it: where it can go, along which path, how long that takes.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "motion/obstacles.h"
#include "motion/trajectory.h"

namespace vantage::motion {

// A path to one goal, or why there is none.
struct PathResult {
  std::optional<Trajectory> trajectory;  // Collision-free and timed.
  std::string refusal;  // Why there is none: "in collision", "out of the workspace", "no path found"; the first two with "start "
                        // before them where it is the start that is at fault. Empty where there is a trajectory.
};

class Mount {
 public:
  virtual ~Mount() = default;

  // Why the mount cannot put the camera there, in the words of PathResult; empty where it can (a path may still be missing). Cheap.
  virtual std::string WhyUnreachable(const geometry::Rigid& T_world_camera) const = 0;

  // Paths from `start` to every goal (same order), planned together on one roadmap. Deterministic: same seed, same paths.
  virtual std::vector<PathResult> Plan(const geometry::Rigid& T_world_camera_start,
                                       const std::vector<geometry::Rigid>& T_world_camera_goals, std::uint32_t seed) const = 0;
};

struct FreeMountParams {
  double camera_radius_m = 0.06;                        // Sphere around the camera that must stay clear; > 0.
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

}  // namespace vantage::motion
