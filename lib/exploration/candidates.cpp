#include <cmath>
#include <stdexcept>

#include "exploration/planner.h"
#include "geometry/view_sphere.h"

namespace vantage::exploration {

void CandidateParams::Check() const {
  if (directions < 1) throw std::invalid_argument("directions must be >= 1, is " + std::to_string(directions));
  if (!(min_elevation_rad >= -M_PI_2 && min_elevation_rad <= max_elevation_rad)) {
    throw std::invalid_argument("min_elevation_rad must be >= -pi/2 and <= max_elevation_rad, is " +
                                std::to_string(min_elevation_rad));
  }
  if (!(max_elevation_rad <= M_PI_2)) {
    throw std::invalid_argument("max_elevation_rad must be <= pi/2, is " + std::to_string(max_elevation_rad));
  }
  if (distances_m.empty()) throw std::invalid_argument("distances_m must have at least one distance, has none");
  for (const double distance_m : distances_m) {
    if (!(distance_m > 0.0)) throw std::invalid_argument("distances_m must be > 0, has " + std::to_string(distance_m));
  }
}

std::vector<CandidateView> SampleCandidates(const geometry::Rigid& T_world_object, const CandidateParams& params) {
  params.Check();
  std::vector<CandidateView> candidates;
  const std::vector<Eigen::Vector3d> directions = geometry::EvenDirections(params.directions);
  for (std::size_t i = 0; i < directions.size(); ++i) {
    const Eigen::Vector3d direction_in_world = T_world_object.linear() * directions[i];
    const double elevation_rad = geometry::Elevation(direction_in_world);
    if (elevation_rad < params.min_elevation_rad || elevation_rad > params.max_elevation_rad) continue;
    for (std::size_t k = 0; k < params.distances_m.size(); ++k) {
      const double distance_m = params.distances_m[k];
      const Eigen::Vector3d eye = T_world_object.translation() + distance_m * direction_in_world;
      CandidateView candidate;
      candidate.id = static_cast<int>(i * params.distances_m.size() + k);
      candidate.T_world_camera = geometry::LookAt(eye, T_world_object.translation(), Eigen::Vector3d::UnitZ());
      candidate.viewpoint = {directions[i], distance_m};
      candidates.push_back(candidate);
    }
  }
  return candidates;
}

measures::Viewpoint ViewpointOf(const geometry::Rigid& T_world_camera, const geometry::Rigid& T_world_object) {
  const Eigen::Vector3d camera_in_object = T_world_object.inverse() * T_world_camera.translation();
  const double distance_m = camera_in_object.norm();
  if (!(distance_m > 0.0)) throw std::invalid_argument("a camera at the object's centre has no viewpoint");
  return {camera_in_object / distance_m, distance_m};
}

}  // namespace vantage::exploration
