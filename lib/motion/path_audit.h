// A second opinion on paths: did the mount touch anything? Independent of planning: no roadmap, no FCL, no hulls, but dense samples
// of the motion and distances from points to boxes and to the convex sets that points span (Frank and Wolfe, 1956).
#pragma once

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "motion/obstacles.h"
#include "motion/trajectory.h"

namespace vantage::motion {

// A ball of the mount's body; radius 0 for a point of its surface. World, metres.
struct BodyBall {
  Eigen::Vector3d centre_in_world;
  double radius_m = 0.0;
};
// What the mount fills at a waypoint.
struct MountBody {
  std::vector<BodyBall> balls;
  double self_clearance_m = std::numeric_limits<double>::infinity();  // Between parts of it that must not touch; negative: they do.
};
using BodyAt = std::function<MountBody(const Waypoint&)>;

// The body of the free camera: one ball around the camera's origin.
BodyAt CameraBall(double radius_m);

struct PathAudit {
  // Least distance found, metres; negative where something is touched; at most kFarAudit_m, beyond which nobody asks.
  double clearance_m = std::numeric_limits<double>::infinity();
  double time_s = 0.0;   // Where that was along the path...
  std::string obstacle;  // ...and to what; "itself" where the mount met itself.

  bool touches() const { return clearance_m < 0.0; }
};
inline constexpr double kFarAudit_m = 0.05;

// Looks at the body every `step_s` along the path. Distances are exact to kAuditTolerance_m: a contact less deep than that may
// pass. Throws std::invalid_argument where step_s is not > 0 or an obstacle has no points. Cost: 1000 samples of one ball, a table
// and three hulls of 1000 points: some 50 ms.
inline constexpr double kAuditTolerance_m = 0.0005;
PathAudit AuditPath(const Trajectory& path, const BodyAt& body, const Obstacles& obstacles, double step_s = 0.005);

}  // namespace vantage::motion
