#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "geometry/camera.h"
#include "geometry/rigid.h"
#include "geometry/view_sphere.h"

namespace vantage::geometry {
namespace {

TEST(Rigid, LookAtPutsTheTargetOnTheOpticalAxisAndUpAboveIt) {
  const Rigid T_world_camera = LookAt({0.5, -0.3, 0.4}, {0.0, 0.1, 0.05}, Eigen::Vector3d::UnitZ());
  const Rigid T_camera_world = T_world_camera.inverse();
  const Eigen::Vector3d target = T_camera_world * Eigen::Vector3d(0.0, 0.1, 0.05);
  EXPECT_NEAR(target.head<2>().norm(), 0.0, 1e-12);
  EXPECT_GT(target.z(), 0.0);
  EXPECT_LT((T_camera_world * Eigen::Vector3d(0.0, 0.1, 0.15)).y(), 0.0);  // Above the target is up in the image.
  EXPECT_NEAR(T_world_camera.linear().determinant(), 1.0, 1e-12);
}

TEST(Rigid, LookAtStraightDownIsStillARotation) {
  const Rigid T = LookAt({0, 0, 1}, {0, 0, 0}, Eigen::Vector3d::UnitZ(), 0.3);
  EXPECT_NEAR((T.linear() * T.linear().transpose() - Eigen::Matrix3d::Identity()).norm(), 0.0, 1e-12);
  EXPECT_THROW(LookAt({0, 0, 1}, {0, 0, 1}, Eigen::Vector3d::UnitZ()), std::invalid_argument);
}

TEST(Rigid, DifferenceAndInterpolationAgree) {
  Rigid a = Rigid::Identity(), b = Rigid::Identity();
  b.rotate(Eigen::AngleAxisd(1.0, Eigen::Vector3d(1, 2, 3).normalized()));
  b.translation() << 0.1, 0.2, 0.3;
  const PoseDifference half = Difference(a, Interpolate(a, b, 0.5));
  EXPECT_NEAR(half.rotation_rad, 0.5, 1e-12);
  EXPECT_NEAR(half.translation_m, 0.5 * b.translation().norm(), 1e-12);
  EXPECT_NEAR(Difference(b, b).rotation_rad, 0.0, 1e-12);
}

TEST(Camera, UnprojectInvertsProjectAlsoWhenCroppedAndScaled) {
  const PinholeCamera camera{640, 480, 525, 520, 319.5, 239.5};
  const Eigen::Vector3d point(0.1, -0.2, 0.8);
  const Eigen::Vector2d pixel = *camera.Project(point);
  EXPECT_NEAR((camera.Unproject(pixel, 0.8) - point).norm(), 0.0, 1e-12);
  EXPECT_NEAR((*camera.Cropped(100, 50, 200, 200).Project(point) - (pixel - Eigen::Vector2d(100, 50))).norm(), 0.0, 1e-12);
  EXPECT_NEAR((camera.Scaled(0.5).Unproject(*camera.Scaled(0.5).Project(point), 0.8) - point).norm(), 0.0, 1e-12);
  EXPECT_FALSE(camera.Project({0, 0, -1}).has_value());
  EXPECT_TRUE(camera.Contains({0, 0}));
  EXPECT_FALSE(camera.Contains({639.6, 0}));
}

TEST(Camera, CheckNamesTheField) {
  PinholeCamera camera{640, 480, 525, -1, 320, 240};
  try {
    camera.Check();
    FAIL() << "a negative focal length passed";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("fy"), std::string::npos) << error.what();
  }
}

TEST(ViewSphere, CellsCoverTheSphereAndFindThemselves) {
  const ViewSphere sphere(24, 12);
  double area = 0.0;
  for (int cell = 0; cell < sphere.size(); ++cell) {
    area += sphere.Area(cell);
    EXPECT_EQ(sphere.CellOf(sphere.Direction(cell)), cell);
  }
  EXPECT_NEAR(area, 1.0, 1e-12);
  EXPECT_THROW(ViewSphere(0, 3), std::invalid_argument);
}

TEST(ViewSphere, EvenDirectionsAreUnitAndBalanced) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& direction : EvenDirections(500)) {
    EXPECT_NEAR(direction.norm(), 1.0, 1e-12);
    sum += direction;
  }
  EXPECT_LT(sum.norm() / 500, 0.01);
}

}  // namespace
}  // namespace vantage::geometry
