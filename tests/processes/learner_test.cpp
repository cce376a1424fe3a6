// The learner process, told by an operator what to learn.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vantage/operator_command_t.hpp>
#include <vantage/scene_t.hpp>
#include <vantage/track_t.hpp>

#include "learner/node.h"
#include "messaging/channels.h"
#include "simulation/simulated_world.h"
#include "support/folder.h"

namespace vantage {
namespace {

class LearnCommand : public ::testing::Test {
 protected:
  LearnCommand() : world_(simulation::LoadWorldParams(std::string(VANTAGE_SOURCE_DIR) + "/config/worlds/clutter.yaml")) {
    learner::LearnerNodeParams params;
    params.store = folder_ / "models.db";
    params.object = "first";
    params.max_rate_hz = 1000.0;
    node_ = std::make_unique<learner::LearnerNode>(bus_, params);
    bus_.Subscribe<track_t>(messaging::kLearnerTrack, [this](const track_t& m) { track_ = m; });
    bus_.Subscribe<scene_t>(messaging::kLearnerScene, [this](const scene_t& m) { scene_ = m; });
  }

  void Command(const std::string& argument) {
    operator_command_t command;
    command.utime = bus_.now_us();
    command.process = "learner";
    command.command = "learn";
    command.argument = argument;
    bus_.Publish(messaging::kOperatorCommand, command);
    Settle();
  }

  void Look() {
    rgbd::Frame frame = world_.Look(world_.StartPose(), ++seed_);
    frame.T_world_camera = world_.StartPose();
    frame.utime = bus_.now_us();
    messaging::FrameSender(bus_).Send(frame);
    Settle();
  }

  // "U,V" of the object's middle in the image.
  std::string PixelOf(int object) const {
    const cv::Mat labels = world_.Labels(world_.StartPose());
    const cv::Moments moments = cv::moments(labels == object, true);
    return std::to_string(std::lround(moments.m10 / moments.m00)) + "," + std::to_string(std::lround(moments.m01 / moments.m00));
  }

  // The two objects that show most of themselves.
  std::pair<int, int> MostVisible() const {
    const cv::Mat labels = world_.Labels(world_.StartPose());
    std::vector<std::pair<int, int>> order;
    for (int object = 0; object < static_cast<int>(world_.Truth().size()); ++object) {
      order.emplace_back(-cv::countNonZero(labels == object), object);
    }
    std::sort(order.begin(), order.end());
    return {order[0].second, order[1].second};
  }

  // From where the learned object stands to where that of the world does, on the table.
  double DistanceTo(int object) const {
    const Eigen::Vector3d learned = node_->learner().T_world_object()->translation();
    const auto truth = world_.Truth()[object];
    return (truth.T_world_object * truth.points.rowwise().mean().eval() - learned).head<2>().norm();
  }

  void Settle() {
    for (int i = 0; i < 3; ++i) {
      bus_.Drain();
      node_->RunStep();
    }
    bus_.Drain();
  }

  simulation::SimulatedWorld world_;
  std::uint32_t seed_ = 0;
  const testing::TemporaryFolder folder_;
  messaging::Bus bus_{"memq://"};
  std::unique_ptr<learner::LearnerNode> node_;
  std::optional<track_t> track_;
  std::optional<scene_t> scene_;
};

TEST_F(LearnCommand, LearnsWhatTheOperatorPointsAtAndGoesOnWithWhatIsStored) {
  const auto [a, b] = MostVisible();
  Command("first " + PixelOf(a));
  Look();
  ASSERT_TRUE(track_);
  ASSERT_TRUE(track_->view_added) << track_->note;
  EXPECT_EQ(track_->object, "first");
  EXPECT_LT(DistanceTo(a), 0.04);
  ASSERT_TRUE(scene_);
  EXPECT_GE(scene_->count, 5);  // The others are listed too.

  Command("second " + PixelOf(b));
  Look();
  ASSERT_TRUE(track_->view_added) << track_->note;
  EXPECT_EQ(track_->object, "second");
  EXPECT_LT(DistanceTo(b), 0.04);

  Command("first");  // No pixel: it is known, and found by recognition.
  Look();
  EXPECT_EQ(track_->object, "first");
  EXPECT_TRUE(track_->tracked) << track_->note;
  EXPECT_LT(DistanceTo(a), 0.04);
  EXPECT_EQ(model::Store(folder_ / "models.db", model::Store::Mode::kRead).List().size(), 2u);
}

}  // namespace
}  // namespace vantage
