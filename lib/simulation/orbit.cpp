#include "simulation/orbit.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>

namespace vantage::simulation {
namespace {

constexpr double kDeg = M_PI / 180.0;

void Require(bool ok, const char* what) {
  if (!ok) throw std::invalid_argument(std::string("orbit: ") + what);
}

double SmoothStep(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

}  // namespace

void OrbitParams::Check() const {
  Require(!elevations_deg.empty(), "elevations_deg must name at least one");
  for (const double elevation : elevations_deg) Require(elevation >= 0.0 && elevation <= 85.0, "elevations_deg must be in [0, 85]");
  Require(distance_m > 0.0, "distance_m must be > 0");
  Require(turn_deg_s > 0.0, "turn_deg_s must be > 0");
  Require(overlap_deg >= 0.0, "overlap_deg must be >= 0");
  Require(rise_s > 0.0, "rise_s must be > 0");
  Require(jitter_m >= 0.0, "jitter_m must be >= 0");
  Require(jitter_deg >= 0.0, "jitter_deg must be >= 0");
}

OrbitPath::OrbitPath(const OrbitParams& params, const Eigen::Vector3d& centre_in_world)
    : params_(params), centre_in_world_(centre_in_world) {
  params_.Check();
  std::mt19937 random(params.seed + 1);
  const auto uniform = [&random] { return static_cast<double>(random()) / 4294967296.0; };
  for (std::size_t axis = 0; axis < waves_.size(); ++axis) {
    // Three sines of deviation s / sqrt(3) each have the deviation s.
    const double deviation = axis < 3 ? params.jitter_m : params.jitter_deg * kDeg;
    for (Wave& wave : waves_[axis]) {
      wave = {deviation * std::sqrt(2.0 / 3.0), 2.0 * M_PI * (0.4 + 2.1 * uniform()), 2.0 * M_PI * uniform()};
    }
  }
}

double OrbitPath::ClosesAt_s(int circle) const {
  const double one_s = (360.0 + params_.overlap_deg) / params_.turn_deg_s + params_.rise_s;
  return circle * one_s + 360.0 / params_.turn_deg_s;
}

double OrbitPath::duration_s() const { return ClosesAt_s(circles() - 1) + params_.overlap_deg / params_.turn_deg_s; }

double OrbitPath::AzimuthAt_deg(double time_s) const { return params_.start_azimuth_deg + params_.turn_deg_s * time_s; }

double OrbitPath::ElevationAt_deg(double time_s) const {
  double elevation = params_.elevations_deg.front();
  for (int circle = 1; circle < circles(); ++circle) {
    const double rises_at_s = ClosesAt_s(circle - 1) + params_.overlap_deg / params_.turn_deg_s;
    elevation +=
        SmoothStep((time_s - rises_at_s) / params_.rise_s) * (params_.elevations_deg[circle] - params_.elevations_deg[circle - 1]);
  }
  return elevation;
}

double OrbitPath::Jitter(int axis, double time_s) const {
  double sum = 0.0;
  for (const Wave& wave : waves_[axis]) sum += wave.amplitude * std::sin(wave.rad_s * time_s + wave.phase);
  return sum;
}

geometry::Rigid OrbitPath::PoseAt(double time_s) const {
  const double azimuth = AzimuthAt_deg(time_s) * kDeg, elevation = ElevationAt_deg(time_s) * kDeg;
  const Eigen::Vector3d direction(std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
                                  std::sin(elevation));
  geometry::Rigid T_world_camera = geometry::LookAt(centre_in_world_ + params_.distance_m * direction, centre_in_world_, {0, 0, 1});
  T_world_camera.translate(Eigen::Vector3d(Jitter(0, time_s), Jitter(1, time_s), Jitter(2, time_s)));
  const Eigen::Vector3d turn(Jitter(3, time_s), Jitter(4, time_s), Jitter(5, time_s));
  if (turn.norm() > 0.0) T_world_camera.rotate(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
  return T_world_camera;
}

Twist OrbitPath::TwistAt(double time_s) const {
  constexpr double kStep_s = 1e-3;
  return TwistBetween(PoseAt(time_s), PoseAt(time_s + kStep_s), kStep_s);
}

}  // namespace vantage::simulation
