// Timed camera motion.
#pragma once

#include <vector>

#include "geometry/rigid.h"

namespace vantage::motion {

struct SpeedLimits {
  double max_speed_m_s = 0.25;                // > 0.
  double max_acceleration_m_s2 = 0.5;         // > 0.
  double max_turn_rate_rad_s = 0.8;           // > 0.
  double max_turn_acceleration_rad_s2 = 1.6;  // > 0.

  void Check() const;  // Throws std::invalid_argument naming the field.
};

struct Waypoint {
  double time_s = 0.0;  // Since the start; ascending.
  geometry::Rigid T_world_mount = geometry::Rigid::Identity();
  Eigen::VectorXd joints_rad = {};  // Of an arm, from its base; empty for a mount without joints.
};

struct Trajectory {
  std::vector<Waypoint> waypoints;

  double duration_s() const { return waypoints.empty() ? 0.0 : waypoints.back().time_s; }
  // The waypoint at a time, the pose at a time; clamped to the ends. Throw std::logic_error where there are no waypoints.
  Waypoint Sample(double time_s) const;
  geometry::Rigid At(double time_s) const { return Sample(time_s).T_world_mount; }
};

// Times a polyline of poses: the mount starts and ends at rest and keeps all four limits along the whole path, translation and
// rotation together (the slower decides). Corners are rounded, by at most `corner_cut_m` off the polyline, and passed without
// stopping, as fast as the accelerations allow; with 0 the mount keeps to the polyline and stops at each corner. Waypoints are at
// most 50 ms apart, so that straight interpolation between them keeps the limits. A single straight move takes the time of the
// trapezoidal profile: L / v + v / a.
// Returns one waypoint where all poses are the same. Throws std::invalid_argument without poses, where one is not finite, where
// corner_cut_m < 0, and what limits.Check() throws. Cost: well under a millisecond for a trip of some seconds.
Trajectory TimePath(const std::vector<geometry::Rigid>& poses, const SpeedLimits& limits, double corner_cut_m = 0.005);

}  // namespace vantage::motion
