#include "motion/hull.h"

#include <libqhullcpp/Qhull.h>
#include <libqhullcpp/QhullFacetList.h>
#include <libqhullcpp/QhullVertexSet.h>

#include <Eigen/Eigenvalues>
#include <stdexcept>
#include <unordered_map>

namespace vantage::motion {
namespace {

// Points with a volume: copies of all points on both sides along each principal axis in which they are too thin.
std::vector<Eigen::Vector3d> Thickened(std::vector<Eigen::Vector3d> points, double min_thickness_m) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& point : points) mean += point / static_cast<double>(points.size());
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const auto& point : points) covariance += (point - mean) * (point - mean).transpose();
  const Eigen::Matrix3d axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance).eigenvectors();
  for (int a = 0; a < 3; ++a) {
    double lowest = 0.0, highest = 0.0;
    for (const auto& point : points) {
      const double along = axes.col(a).dot(point - mean);
      lowest = std::min(lowest, along);
      highest = std::max(highest, along);
    }
    if (highest - lowest >= min_thickness_m) continue;
    const std::size_t count = points.size();
    for (std::size_t i = 0; i < count; ++i) {
      points.push_back(points[i] + axes.col(a) * min_thickness_m / 2.0);
      points[i] -= axes.col(a) * min_thickness_m / 2.0;
    }
  }
  return points;
}

}  // namespace

Hull ConvexHull(const std::vector<Eigen::Vector3d>& points, double min_thickness_m) {
  if (points.empty()) throw std::invalid_argument("a hull needs at least one point, has none");
  for (const auto& point : points) {
    if (!point.allFinite()) throw std::invalid_argument("a hull's point is not finite");
  }
  const std::vector<Eigen::Vector3d> solid = Thickened(points, min_thickness_m);
  static_assert(sizeof(Eigen::Vector3d) == 3 * sizeof(double));
  orgQhull::Qhull qhull;
  qhull.runQhull("", 3, static_cast<int>(solid.size()), solid.front().data(), "Qt");

  Hull hull;
  std::unordered_map<int, int> index_of_point;
  for (const orgQhull::QhullFacet& facet : qhull.facetList()) {
    if (!facet.isGood()) continue;
    std::array<int, 3> triangle{};
    int corner = 0;
    for (const orgQhull::QhullVertex& vertex : facet.vertices()) {
      const int id = vertex.point().id();
      const auto [entry, is_new] = index_of_point.emplace(id, static_cast<int>(hull.vertices.size()));
      if (is_new) hull.vertices.push_back(solid[static_cast<std::size_t>(id)]);
      triangle.at(static_cast<std::size_t>(corner++)) = entry->second;
    }
    // Qhull lists a facet's vertices by their number; its top orientation says that this runs clockwise seen from outside.
    if (facet.isTopOrient()) std::swap(triangle[1], triangle[2]);
    hull.triangles.push_back(triangle);
  }
  return hull;
}

}  // namespace vantage::motion
