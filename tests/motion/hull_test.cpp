// Convex hulls: what is a corner, what is a face, and which side of a face is outside.
#include "motion/hull.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "motion/support.h"

namespace vantage::motion {
namespace {

Eigen::Vector3d CornerOf(const Hull& hull, const std::array<int, 3>& triangle, int corner) {
  return hull.vertices[static_cast<std::size_t>(triangle.at(static_cast<std::size_t>(corner)))];
}

// Every point is behind every face, seen along the side from which the face's corners run counter-clockwise.
void ExpectFacesOutwards(const Hull& hull, const std::vector<Eigen::Vector3d>& points, double beyond_m) {
  for (const auto& triangle : hull.triangles) {
    const Eigen::Vector3d a = CornerOf(hull, triangle, 0);
    const Eigen::Vector3d normal = (CornerOf(hull, triangle, 1) - a).cross(CornerOf(hull, triangle, 2) - a).normalized();
    double furthest_m = 0.0;
    for (const auto& point : points) furthest_m = std::max(furthest_m, normal.dot(point - a));
    EXPECT_LT(furthest_m, beyond_m) << "face at " << a.transpose();
  }
}

TEST(Hull, FacesOfACubeRunCounterClockwiseSeenFromOutside) {
  const auto corners = CubeCorners({0.3, -0.2, 0.7}, 0.2);
  const Hull hull = ConvexHull(corners);
  EXPECT_EQ(hull.vertices.size(), 8u);
  EXPECT_EQ(hull.triangles.size(), 12u);
  ExpectFacesOutwards(hull, corners, 1e-6);
}

TEST(Hull, FacesOfManyPointsRunCounterClockwiseSeenFromOutside) {
  Random random(3);
  for (int cloud = 0; cloud < 10; ++cloud) {
    std::vector<Eigen::Vector3d> points;
    for (int i = 0; i < 200; ++i) points.emplace_back(Eigen::Vector3d(1, 0, 2) + random.Point(0.1));
    ExpectFacesOutwards(ConvexHull(points), points, 1e-6);
  }
}

TEST(Hull, FlatPointsAreThickenedAndStillFaceOutwards) {
  Random random(4);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 50; ++i) points.emplace_back(random.Point(0.1).cwiseProduct(Eigen::Vector3d(1, 1, 0)));
  ExpectFacesOutwards(ConvexHull(points, 0.01), points, 1e-6);
}

}  // namespace
}  // namespace vantage::motion
