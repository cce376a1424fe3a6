#include "messaging/mount_messages.h"

#include <gtest/gtest.h>

#include <cmath>

#include "messaging/bus.h"

namespace vantage::messaging {
namespace {

motion::Trajectory StraightLine(int waypoints) {
  motion::Trajectory trajectory;
  for (int i = 0; i < waypoints; ++i) {
    geometry::Rigid pose = geometry::Rigid::Identity();
    pose.translation().x() = 0.01 * i;
    trajectory.waypoints.push_back({0.05 * i, pose});
  }
  return trajectory;
}

TEST(MountMessages, JointsGoThereAndBack) {
  motion::Trajectory trajectory = StraightLine(3);
  for (auto& waypoint : trajectory.waypoints) waypoint.joints_rad = Eigen::VectorXd::LinSpaced(6, -1.0, 1.0 + waypoint.time_s);
  mount_command_t message = ToMessage(trajectory, 1, 2);
  const auto back = FromMessage(message);
  ASSERT_TRUE(back) << back.error;
  EXPECT_EQ(back->waypoints[2].joints_rad, trajectory.waypoints[2].joints_rad);
  message.waypoints[1].joints_rad[3] = std::nan("");
  EXPECT_NE(FromMessage(message).error.find("waypoint 1"), std::string::npos);
  message = ToMessage(trajectory, 1, 2);
  message.waypoints[2].joints_rad.pop_back();
  EXPECT_NE(FromMessage(message).error.find("equally many"), std::string::npos);
  MountState state;
  state.joints_rad = Eigen::VectorXd::LinSpaced(6, -1.0, 1.0);
  EXPECT_EQ(FromMessage(ToMessage(state))->joints_rad, state.joints_rad);
  state.joints_rad = Eigen::VectorXd::Zero(17);
  EXPECT_FALSE(FromMessage(ToMessage(state)));
}

TEST(MountMessages, TrajectoriesSurviveTheWire) {
  const auto trajectory = StraightLine(20);
  const auto back = FromMessage(ToMessage(trajectory, 4, 123));
  ASSERT_TRUE(back) << back.error;
  ASSERT_EQ(back->waypoints.size(), 20u);
  EXPECT_DOUBLE_EQ(back->waypoints[19].time_s, trajectory.waypoints[19].time_s);
  EXPECT_TRUE(back->waypoints[19].T_world_mount.isApprox(trajectory.waypoints[19].T_world_mount));
}

TEST(MountMessages, AMinuteOfMotionFitsIntoOneMessage) {
  EXPECT_LT(ToMessage(StraightLine(1200), 1, 1).getEncodedSize(), kMaxMessageBytes);
}

TEST(MountMessages, TimesThatDoNotAscendAreRefused) {
  auto message = ToMessage(StraightLine(5), 1, 1);
  message.waypoints[3].time_s = message.waypoints[2].time_s;
  EXPECT_FALSE(FromMessage(message));
  message.waypoints[3].time_s = std::nan("");
  EXPECT_FALSE(FromMessage(message));
  message = ToMessage(StraightLine(5), 1, 1);
  message.waypoints[0].time_s = 0.5;
  EXPECT_FALSE(FromMessage(message));
  message = ToMessage(StraightLine(5), 1, 1);
  message.waypoints[4].T_world_mount.position[0] = std::nan("");
  EXPECT_NE(FromMessage(message).error.find("waypoint 4"), std::string::npos);
}

TEST(MountMessages, StatesSurviveTheWire) {
  MountState state;
  state.utime = 5;
  state.moving = true;
  state.command_id = 17;
  state.result = MountState::Result::kRefused;
  state.refusal = "too fast";
  state.T_mount_camera.translation().z() = 0.1;
  const auto back = FromMessage(ToMessage(state));
  ASSERT_TRUE(back) << back.error;
  EXPECT_EQ(back->utime, 5);
  EXPECT_EQ(back->command_id, 17);
  EXPECT_EQ(back->result, MountState::Result::kRefused);
  EXPECT_EQ(back->refusal, "too fast");
  EXPECT_DOUBLE_EQ(back->T_world_camera().translation().z(), 0.1);

  auto bad = ToMessage(state);
  bad.result = 99;
  EXPECT_FALSE(FromMessage(bad));
}

}  // namespace
}  // namespace vantage::messaging
