// A hand-held camera that circles an object: the path from which the learner is judged.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "geometry/rigid.h"
#include "simulation/motion_blur.h"

namespace vantage::simulation {

struct OrbitParams {
  std::vector<double> elevations_deg = {30.0, 55.0};  // One full circle at each, in this order; each in [0, 85].
  double distance_m = 0.7;                            // From the object's middle; > 0.
  double start_azimuth_deg = 0.0;                     // About the world's z from x.
  double turn_deg_s = 30.0;                           // Speed about the object; > 0.
  double overlap_deg = 15.0;                          // Every circle goes on for so much, over what it saw first; >= 0.
  double rise_s = 1.0;                                // From one elevation to the next; > 0.
  double jitter_m = 0.002;                            // Of the hand: deviation of the position, a few Hz; >= 0.
  double jitter_deg = 0.3;                            // ...and of the direction; >= 0.
  std::uint32_t seed = 0;                             // Of the jitter.

  void Check() const;  // Throws std::invalid_argument naming the field.
};

class OrbitPath {
 public:
  // About a point of the world (metres). Throws as OrbitParams::Check.
  OrbitPath(const OrbitParams& params, const Eigen::Vector3d& centre_in_world);

  double duration_s() const;
  // When the circle with this index has come round once (its overlap follows).
  double ClosesAt_s(int circle) const;
  int circles() const { return static_cast<int>(params_.elevations_deg.size()); }

  geometry::Rigid PoseAt(double time_s) const;  // T_world_camera; smooth in time, which may pass the duration.
  Twist TwistAt(double time_s) const;
  double AzimuthAt_deg(double time_s) const;  // Unwrapped.
  double ElevationAt_deg(double time_s) const;

 private:
  struct Wave {
    double amplitude, rad_s, phase;
  };
  double Jitter(int axis, double time_s) const;

  OrbitParams params_;
  Eigen::Vector3d centre_in_world_;
  std::array<std::array<Wave, 3>, 6> waves_;  // Position (x y z), direction (x y z).
};

}  // namespace vantage::simulation
