#include "rendering/surface_distance.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

namespace vantage::rendering {
namespace {

// Distance to the surface of an axis-aligned box centred at the origin.
double BoxDistance(const Eigen::Vector3d& p, const Eigen::Vector3d& size) {
  const Eigen::Vector3d beyond = p.cwiseAbs() - size / 2;
  return beyond.maxCoeff() > 0.0 ? beyond.cwiseMax(0.0).norm() : -beyond.maxCoeff();
}

TEST(SurfaceDistance, AgreesWithABoxInsideAndOutside) {
  const Eigen::Vector3d size(0.1, 0.2, 0.3);
  const SurfaceDistance distance(BoxMesh(size, {cv::Mat(8, 8, CV_8UC3, cv::Scalar::all(9))}));
  std::srand(1);
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3d p = 0.3 * Eigen::Vector3d::Random();
    EXPECT_NEAR(distance(p), BoxDistance(p, size), 1e-6) << p.transpose();
  }
}

TEST(SurfaceDistance, PointsOfTheSurfaceAreOnIt) {
  const Mesh mesh = BoxMesh({0.1, 0.2, 0.3}, {cv::Mat(8, 8, CV_8UC3, cv::Scalar::all(9))});
  const SurfaceDistance distance(mesh);
  for (const double d : distance.Of(SampleSurface(mesh, 200, 1))) EXPECT_LT(d, 1e-6);
  EXPECT_THROW(SurfaceDistance(Mesh{}), std::invalid_argument);
}

}  // namespace
}  // namespace vantage::rendering
