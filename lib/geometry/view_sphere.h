// The view sphere around an object as a grid of azimuth x elevation cells: where a camera can stand and look at it.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace vantage::geometry {

// Cells of equal azimuth and elevation steps; a cell's weight is its share of the sphere's area. Directions point from the object
// to the camera, in object coordinates (z up). Cell index = elevation row * azimuth_cells + azimuth column, rows from the south
// pole.
class ViewSphere {
 public:
  // Throws std::invalid_argument where a count is < 1.
  explicit ViewSphere(int azimuth_cells = 36, int elevation_cells = 18);

  int azimuth_cells() const { return azimuth_cells_; }
  int elevation_cells() const { return elevation_cells_; }
  int size() const { return azimuth_cells_ * elevation_cells_; }

  Eigen::Vector3d Direction(int cell) const;  // Unit vector to the cell's centre.
  double Area(int cell) const;                // Share of the sphere; all cells sum to 1.
  int CellOf(const Eigen::Vector3d& direction) const;

 private:
  int azimuth_cells_;
  int elevation_cells_;
};

// `count` directions spread evenly over the sphere (a Fibonacci lattice), unit vectors, from the south pole up.
std::vector<Eigen::Vector3d> EvenDirections(int count);

// Azimuth in (-pi, pi] about z from x; elevation in [-pi/2, pi/2] above the xy plane. Radians.
double Azimuth(const Eigen::Vector3d& direction);
double Elevation(const Eigen::Vector3d& direction);

}  // namespace vantage::geometry
