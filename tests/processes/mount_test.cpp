#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <vantage/operator_command_t.hpp>
#include <vector>

#include "common/calibration_file.h"
#include "messaging/channels.h"
#include "motion/arm_model.h"
#include "mount/node.h"
#include "support/temp_folder.h"

namespace vantage::mount {
namespace {

using messaging::MountState;

// A mount on a bus whose clock the test turns.
class MountTest : public ::testing::Test {
 protected:
  MountTest() : bus_("memq://", [this] { return now_us_; }) {
    bus_.Subscribe<mount_state_t>(messaging::kMountState, [this](const mount_state_t& message) {
      const auto state = messaging::FromMessage(message);
      ASSERT_TRUE(state) << state.error;
      states_.push_back(*state);
    });
    node_ = std::make_unique<MountNode>(bus_, MountParams());
    Run(0.1);
  }

  void Run(double seconds) {
    const auto end_us = now_us_ + static_cast<std::int64_t>(seconds * 1e6);
    while (now_us_ < end_us) {
      now_us_ += 5000;
      bus_.Drain();
      node_->RunStep();
    }
    bus_.Drain();
  }

  motion::Trajectory Path(const Eigen::Vector3d& by_m) const {
    geometry::Rigid goal = node_->state().T_world_mount;
    goal.translation() += by_m;
    return motion::TimePath({node_->state().T_world_mount, goal}, motion::SpeedLimits());
  }

  void Send(const motion::Trajectory& trajectory, std::int64_t id) {
    bus_.Publish(messaging::kMountCommand, messaging::ToMessage(trajectory, id, now_us_));
  }

  std::int64_t now_us_ = 1000000;
  messaging::Bus bus_;
  std::unique_ptr<MountNode> node_;
  std::vector<MountState> states_;
};

TEST(ArmMountTest, DrivesJointsAndRefusesWhatIsNoWayForThem) {
  std::int64_t now_us = 1000000;
  messaging::Bus bus("memq://", [&now_us] { return now_us; });
  MountParams params;
  params.mount.type = "arm";
  params.mount.arm.urdf = std::string(VANTAGE_SOURCE_DIR) + "/config/robots/arm.urdf";
  MountNode node(bus, params);
  ASSERT_EQ(node.state().joints_rad.size(), 6);
  EXPECT_EQ(Eigen::Vector3d(node.state().T_mount_camera.translation()), params.mount.arm.camera_position_m);
  const Eigen::Vector3d eye = node.state().T_world_camera().translation();
  EXPECT_LT((eye - params.start_eye_m).norm(), 1e-3);

  const auto arm = motion::MountMaker(params.mount).Make({});
  const geometry::Rigid goal = geometry::LookAt({0.3, 0.4, 0.5}, {0, 0, 0.08}, Eigen::Vector3d::UnitZ());
  const auto planned = arm->Plan({node.state().T_world_camera(), node.state().joints_rad}, {goal}, 0);
  ASSERT_TRUE(planned[0].trajectory.has_value()) << planned[0].refusal;
  motion::Trajectory path = *planned[0].trajectory;
  for (auto& waypoint : path.waypoints) waypoint.T_world_mount = waypoint.T_world_mount * node.state().T_mount_camera.inverse();
  const auto send = [&](const motion::Trajectory& trajectory, std::int64_t id) {
    bus.Publish(messaging::kMountCommand, messaging::ToMessage(trajectory, id, now_us));
    bus.Drain();
    node.RunStep();
  };

  motion::Trajectory poses_only = path;
  for (auto& waypoint : poses_only.waypoints) waypoint.joints_rad = {};
  send(poses_only, 1);
  EXPECT_EQ(node.state().refusal, "needs 6 joints, has 0");
  motion::Trajectory hasty = path;
  for (auto& waypoint : hasty.waypoints) waypoint.time_s /= 3.0;
  send(hasty, 2);
  EXPECT_NE(node.state().refusal.find("turns at"), std::string::npos) << node.state().refusal;
  motion::Trajectory elsewhere = path;
  for (auto& waypoint : elsewhere.waypoints) waypoint.joints_rad[0] += 0.2;
  send(elsewhere, 3);
  EXPECT_NE(node.state().refusal.find("is not where the arm is"), std::string::npos) << node.state().refusal;

  send(path, 4);
  EXPECT_EQ(node.state().refusal, "");
  now_us += static_cast<std::int64_t>(1e6 * (path.duration_s() + 0.1));
  node.RunStep();
  EXPECT_EQ(node.state().result, MountState::Result::kArrived);
  EXPECT_LT((node.state().T_world_camera().translation() - goal.translation()).norm(), 1e-3);
  EXPECT_EQ(node.state().joints_rad, path.waypoints.back().joints_rad);
}

// `vantage calibrate --hand-eye` wrote it; both mounts carry their camera so.
TEST(HandEye, TheCameraIsWhereTheCalibrationSays) {
  const testing::TempFolder folder;
  processes::HandEyeFile seat;
  seat.T_mount_camera.linear() = Eigen::AngleAxisd(0.7, Eigen::Vector3d(2, -1, 1).normalized()).toRotationMatrix();
  seat.T_mount_camera.translation() = Eigen::Vector3d(0.03, -0.05, 0.08);
  folder.Write("hand.yaml", processes::ToYaml(seat));
  folder.Write("mount.yaml", "camera_position_m: [1.0, 0.0, 0.0]\n");
  const std::string urdf = std::string(VANTAGE_SOURCE_DIR) + "/config/robots/arm.urdf";
  folder.Write("free.yaml", "hand_eye: hand.yaml\n");
  folder.Write("arm.yaml", "hand_eye: hand.yaml\nmount: {type: arm, arm: {urdf: " + urdf + "}}\n");
  for (const std::string type : {"free", "arm"}) {
    SCOPED_TRACE(type);
    std::int64_t now_us = 1000000;
    messaging::Bus bus("memq://", [&now_us] { return now_us; });
    std::vector<MountState> states;
    bus.Subscribe<mount_state_t>(messaging::kMountState,
                                 [&](const mount_state_t& message) { states.push_back(*messaging::FromMessage(message)); });
    const MountParams params = LoadMountParams(folder / "mount.yaml", folder / (type + ".yaml"));
    MountNode node(bus, params);
    node.RunStep();
    bus.Drain();
    ASSERT_FALSE(states.empty());
    const MountState& state = states.back();
    EXPECT_TRUE(state.T_mount_camera.isApprox(seat.T_mount_camera, 1e-9)) << state.T_mount_camera.matrix();
    const auto wanted = geometry::LookAt(params.start_eye_m, params.start_target_m, Eigen::Vector3d::UnitZ());
    EXPECT_LT((state.T_world_camera().translation() - wanted.translation()).norm(), 2e-4);
    EXPECT_LT(geometry::AngleBetween(state.T_world_camera().linear().col(2), wanted.linear().col(2)), 1e-3);
    if (type == "free") continue;
    // What is told of the mount is where the joints put the last link, the camera left aside.
    motion::ArmMountParams bare = params.mount.arm;
    bare.camera_position_m = bare.camera_rotation_rad = Eigen::Vector3d::Zero();
    const geometry::Rigid T_world_link = motion::LoadArm(bare)->CameraPose(state.joints_rad);
    EXPECT_LT(geometry::Difference(state.T_world_mount, T_world_link).translation_m, 1e-6);
    EXPECT_LT(geometry::Difference(state.T_world_mount, T_world_link).rotation_rad, 1e-6);
  }
}

TEST_F(MountTest, SaysWhereItIsThirtyTimesASecond) {
  states_.clear();
  Run(2.0);
  EXPECT_NEAR(static_cast<double>(states_.size()), 60.0, 4.0);
  EXPECT_EQ(states_.back().result, MountState::Result::kIdle);
  EXPECT_TRUE(states_.back().T_world_camera().translation().isApprox(MountParams().start_eye_m, 1e-9));
}

TEST_F(MountTest, DrivesATrajectoryInTimeAndWithinTheLimits) {
  const auto path = Path({0.0, 0.3, 0.1});
  const auto goal = path.waypoints.back().T_world_mount;
  Send(path, 7);
  Run(path.duration_s() * 0.5);
  EXPECT_TRUE(states_.back().moving);
  EXPECT_EQ(states_.back().result, MountState::Result::kExecuting);
  EXPECT_GT(geometry::Difference(states_.back().T_world_mount, goal).translation_m, 0.05);
  Run(path.duration_s() * 0.5 + 0.2);
  EXPECT_FALSE(states_.back().moving);
  EXPECT_EQ(states_.back().result, MountState::Result::kArrived);
  EXPECT_EQ(states_.back().command_id, 7);
  EXPECT_LT(geometry::Difference(states_.back().T_world_mount, goal).translation_m, 1e-9);
  for (std::size_t i = 1; i < states_.size(); ++i) {
    const double time_s = 1e-6 * static_cast<double>(states_[i].utime - states_[i - 1].utime);
    const double step_m = geometry::Difference(states_[i].T_world_mount, states_[i - 1].T_world_mount).translation_m;
    EXPECT_LE(step_m, 1.05 * motion::SpeedLimits().max_speed_m_s * time_s + 1e-9);
  }
}

TEST_F(MountTest, RefusesWhatItMustNotDriveAndStaysWhereItIs) {
  const auto start = node_->state().T_world_mount;
  auto fast = Path({0.0, 0.3, 0.0});
  for (auto& waypoint : fast.waypoints) waypoint.time_s *= 0.5;
  Send(fast, 1);
  Run(0.1);
  EXPECT_EQ(states_.back().result, MountState::Result::kRefused);
  EXPECT_NE(states_.back().refusal.find("m/s"), std::string::npos) << states_.back().refusal;

  auto elsewhere = Path({0.0, 0.3, 0.0});
  for (auto& waypoint : elsewhere.waypoints) waypoint.T_world_mount.translation().x() += 0.1;
  Send(elsewhere, 2);
  Run(0.1);
  EXPECT_EQ(states_.back().command_id, 2);
  EXPECT_NE(states_.back().refusal.find("where the mount is"), std::string::npos) << states_.back().refusal;

  auto broken = messaging::ToMessage(Path({0.0, 0.3, 0.0}), 3, now_us_);
  broken.waypoints[2].T_world_mount.position[0] = std::nan("");
  bus_.Publish(messaging::kMountCommand, broken);
  Run(0.1);
  EXPECT_EQ(states_.back().command_id, 3);
  EXPECT_EQ(states_.back().result, MountState::Result::kRefused);
  EXPECT_EQ(node_->bad(), 1);

  bus_.PublishRaw(messaging::kMountCommand, "rubbish", 7);
  Run(0.1);
  EXPECT_EQ(node_->bad(), 2);
  EXPECT_TRUE(node_->state().T_world_mount.isApprox(start));
}

TEST_F(MountTest, AnotherCommandMeanwhileIsNotDrivenAndTheSameAgainIsNoMatter) {
  const auto path = Path({0.0, 0.3, 0.0});
  Send(path, 1);
  Run(0.3);
  Send(path, 1);
  Send(Path({0.1, 0.0, 0.0}), 2);
  Run(path.duration_s());
  EXPECT_EQ(states_.back().command_id, 1);
  EXPECT_EQ(states_.back().result, MountState::Result::kArrived);
  EXPECT_LT(geometry::Difference(states_.back().T_world_mount, path.waypoints.back().T_world_mount).translation_m, 1e-9);
}

TEST_F(MountTest, StopsAtOnce) {
  Send(Path({0.0, 0.3, 0.0}), 1);
  Run(0.5);
  operator_command_t stop;
  stop.utime = now_us_;
  stop.command = "stop";
  bus_.Publish(messaging::kOperatorCommand, stop);
  Run(0.1);
  const auto where = states_.back().T_world_mount;
  EXPECT_EQ(states_.back().result, MountState::Result::kStopped);
  Run(1.0);
  EXPECT_TRUE(states_.back().T_world_mount.isApprox(where));
  Send(Path({0.0, -0.05, 0.0}), 2);
  Run(2.0);
  EXPECT_EQ(states_.back().result, MountState::Result::kArrived);
}

TEST(MountParams, FilesAreReadStrictly) {
  const auto file = std::filesystem::temp_directory_path() / "vantage_mount_test.yaml";
  const auto error_of = [&](const std::string& text) -> std::string {
    std::ofstream(file) << text;
    try {
      LoadMountParams(file.string());
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(error_of("rate_hz: 50\nlimits:\n  max_speed_m_s: 0.1\n"), "");
  EXPECT_NE(error_of("rate_khz: 50\n").find("rate_khz"), std::string::npos);
  EXPECT_NE(error_of("limits:\n  max_sped: 0.1\n").find("max_sped"), std::string::npos);
  EXPECT_NE(error_of("rate_hz: -1\n").find("rate_hz must be in"), std::string::npos);
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace vantage::mount
