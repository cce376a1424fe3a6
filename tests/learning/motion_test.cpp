// Where the last frames say an object is.
#include "learning/motion.h"

#include <gtest/gtest.h>

namespace vantage::learning {
namespace {

constexpr std::int64_t kFrame_us = 33000;

geometry::PinholeCamera TestCamera() { return {640, 480, 525.0, 525.0, 319.5, 239.5}; }

model::ObjectModel TwoPoints() {
  model::ObjectModel object;
  object.points.push_back({Eigen::Vector3d(0.05, 0.0, 0.0), Eigen::Vector3d::UnitX()});
  object.points.push_back({Eigen::Vector3d(-0.05, 0.0, 0.0), -Eigen::Vector3d::UnitX()});
  return object;
}

// Turning 2 degrees a frame, and coming nearer.
geometry::Rigid PoseAt(int frame) {
  geometry::Rigid T = geometry::Rigid::Identity();
  T.translation() = Eigen::Vector3d(0.0, 0.0, 0.8);
  T.rotate(Eigen::AngleAxisd(2.0 * frame * M_PI / 180.0, Eigen::Vector3d::UnitY()));
  T.translate(Eigen::Vector3d(0.0, 0.001 * frame, 0.0));
  return T;
}

Motion SeenUntil(int frame) {
  Motion motion;
  for (int i = 0; i <= frame; ++i) motion.Found(TwoPoints(), TestCamera(), PoseAt(i), i * kFrame_us);
  return motion;
}

TEST(Motion, LeadsOnAsItWas) {
  const Motion motion = SeenUntil(5);
  ASSERT_TRUE(motion.IsSteady(6 * kFrame_us));
  EXPECT_TRUE(motion.Predicted(6 * kFrame_us)->isApprox(PoseAt(6), 1e-9));
  EXPECT_TRUE(motion.Predicted(7 * kFrame_us)->isApprox(PoseAt(7), 1e-4));
  EXPECT_NEAR(motion.error_px(), 0.0, 0.01);
}

TEST(Motion, AfterAGapThereIsOnlyAPlace) {
  Motion motion = SeenUntil(5);
  const std::int64_t later = 5 * kFrame_us + 400000;
  EXPECT_FALSE(motion.IsSteady(later));
  EXPECT_TRUE(motion.Predicted(later)->isApprox(PoseAt(5)));
  motion.Found(TwoPoints(), TestCamera(), PoseAt(30), later);
  EXPECT_FALSE(motion.IsSteady(later + kFrame_us));  // One frame is no motion.
  EXPECT_EQ(motion.error_px(), 0.0);
  motion.Lost();
  EXPECT_FALSE(motion.Predicted(later + kFrame_us));
}

TEST(Motion, SaysHowFarItWasOff) {
  Motion motion = SeenUntil(5);
  geometry::Rigid aside = PoseAt(6);
  aside.pretranslate(Eigen::Vector3d(0.0, 0.008, 0.0));  // 5 px at 0.8 m.
  motion.Found(TwoPoints(), TestCamera(), aside, 6 * kFrame_us);
  EXPECT_NEAR(motion.error_px(), 5.3, 0.5);
}

TEST(Motion, NewObjectCoordinatesDoNotMoveItInTheImage) {
  Motion motion = SeenUntil(5);
  geometry::Rigid T_before_after = geometry::Rigid::Identity();
  T_before_after.translate(Eigen::Vector3d(0.01, -0.02, 0.03)).rotate(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitZ()));
  motion.ChangeObject(T_before_after);
  EXPECT_TRUE(motion.Predicted(6 * kFrame_us)->isApprox(PoseAt(6) * T_before_after, 1e-6));
}

}  // namespace
}  // namespace vantage::learning
