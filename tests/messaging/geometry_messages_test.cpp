#include "messaging/geometry_messages.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace vantage::messaging {
namespace {

TEST(GeometryMessages, PosesSurviveTheWire) {
  const unsigned seed = 7;
  SCOPED_TRACE(seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-3.0, 3.0);
  for (int i = 0; i < 50; ++i) {
    geometry::Rigid T = geometry::Rigid::Identity();
    T.linear() =
        Eigen::Quaterniond(uniform(random), uniform(random), uniform(random), uniform(random)).normalized().toRotationMatrix();
    T.translation() = Eigen::Vector3d(uniform(random), uniform(random), uniform(random));
    const auto back = FromMessage(ToMessage(T));
    ASSERT_TRUE(back) << back.error;
    EXPECT_TRUE(back->isApprox(T, 1e-12));
  }
}

TEST(GeometryMessages, BadPosesAreErrorsNotExceptions) {
  const pose_t good = ToMessage(geometry::Rigid::Identity());
  pose_t bad = good;
  bad.position[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(FromMessage(bad));
  bad = good;
  bad.position[2] = 1e9;
  EXPECT_FALSE(FromMessage(bad));
  bad = good;
  bad.orientation[0] = 0.0;
  const auto result = FromMessage(bad);
  EXPECT_FALSE(result);
  EXPECT_NE(result.error.find("quaternion"), std::string::npos);
  bad.orientation[0] = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(FromMessage(bad));
}

TEST(GeometryMessages, CamerasAreChecked) {
  geometry::PinholeCamera camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx = 525.0;
  camera.fy = 526.0;
  camera.cx = 319.5;
  camera.cy = 239.5;
  const auto back = FromMessage(ToMessage(camera));
  ASSERT_TRUE(back) << back.error;
  EXPECT_EQ(*back, camera);

  camera_t bad = ToMessage(camera);
  bad.width = 100000000;
  EXPECT_FALSE(FromMessage(bad));
  bad = ToMessage(camera);
  bad.fy = -1.0;
  EXPECT_FALSE(FromMessage(bad));
  bad.fy = std::nan("");
  EXPECT_FALSE(FromMessage(bad));
}

}  // namespace
}  // namespace vantage::messaging
