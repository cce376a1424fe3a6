// Convex hulls of points as triangles (Qhull); internal to motion.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

namespace vantage::motion {

struct Hull {
  std::vector<Eigen::Vector3d> vertices;      // Corners of the hull only.
  std::vector<std::array<int, 3>> triangles;  // Indices into vertices, counter-clockwise seen from outside.
};

// The hull of at least one finite point. Extents below `min_thickness_m` along a principal axis are thickened to that, so that a
// hull always has a volume. Throws std::invalid_argument where there is no point or a coordinate is not finite.
Hull ConvexHull(const std::vector<Eigen::Vector3d>& points, double min_thickness_m = 0.001);

}  // namespace vantage::motion
