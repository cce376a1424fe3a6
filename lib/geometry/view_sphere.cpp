#include "geometry/view_sphere.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace vantage::geometry {

ViewSphere::ViewSphere(int azimuth_cells, int elevation_cells) : azimuth_cells_(azimuth_cells), elevation_cells_(elevation_cells) {
  if (azimuth_cells < 1 || elevation_cells < 1) throw std::invalid_argument("ViewSphere: cell counts must be >= 1");
}

Eigen::Vector3d ViewSphere::Direction(int cell) const {
  const double azimuth = -M_PI + 2.0 * M_PI * (cell % azimuth_cells_ + 0.5) / azimuth_cells_;
  const double elevation = -M_PI_2 + M_PI * (cell / azimuth_cells_ + 0.5) / elevation_cells_;
  return {std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth), std::sin(elevation)};
}

double ViewSphere::Area(int cell) const {
  const int row = cell / azimuth_cells_;
  const double south = -M_PI_2 + M_PI * row / elevation_cells_;
  const double north = south + M_PI / elevation_cells_;
  return (std::sin(north) - std::sin(south)) / (2.0 * azimuth_cells_);
}

int ViewSphere::CellOf(const Eigen::Vector3d& direction) const {
  const double u = (Azimuth(direction) + M_PI) / (2.0 * M_PI);
  const double v = (Elevation(direction) + M_PI_2) / M_PI;
  const int column = std::clamp(static_cast<int>(u * azimuth_cells_), 0, azimuth_cells_ - 1);
  const int row = std::clamp(static_cast<int>(v * elevation_cells_), 0, elevation_cells_ - 1);
  return row * azimuth_cells_ + column;
}

std::vector<Eigen::Vector3d> EvenDirections(int count) {
  const double golden_angle = M_PI * (3.0 - std::sqrt(5.0));
  std::vector<Eigen::Vector3d> directions;
  for (int i = 0; i < count; ++i) {
    const double z = -1.0 + (2.0 * i + 1.0) / count;
    const double radius = std::sqrt(1.0 - z * z);
    directions.emplace_back(radius * std::cos(golden_angle * i), radius * std::sin(golden_angle * i), z);
  }
  return directions;
}

double Azimuth(const Eigen::Vector3d& direction) { return std::atan2(direction.y(), direction.x()); }

double Elevation(const Eigen::Vector3d& direction) { return std::atan2(direction.z(), direction.head<2>().norm()); }

}  // namespace vantage::geometry
