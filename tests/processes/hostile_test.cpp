// A bus on which somebody says what is wrong: other types, messages cut off, absurd sizes, values that are no numbers, time that
// goes backwards, bits that flip. Every node counts, warns, and goes on.
#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <vantage/answer_t.hpp>
#include <vantage/object_prior_t.hpp>
#include <vantage/operator_command_t.hpp>
#include <vantage/plan_t.hpp>
#include <vantage/query_t.hpp>
#include <vantage/status_t.hpp>

#include "assessor/node.h"
#include "learner/node.h"
#include "messaging/channels.h"
#include "messaging/geometry_messages.h"
#include "messaging/known_types.h"
#include "mount/node.h"
#include "planner/node.h"
#include "recogniser/node.h"
#include "sensor/node.h"
#include "support/folder.h"

namespace vantage {
namespace {

using Bytes = std::vector<std::uint8_t>;
using Said = std::pair<std::string, Bytes>;  // On which channel, what.

constexpr std::int64_t kNow_us = 1700000000000000;
constexpr std::uint32_t kSeed = 7;

template <typename Message>
Said Say(const std::string& channel, const Message& message) {
  Bytes bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return {channel, bytes};
}

rgbd::Frame BlankFrame(std::int64_t utime) {
  rgbd::Frame frame;
  frame.utime = utime;
  frame.color = cv::Mat(48, 64, CV_8UC3, cv::Scalar(90, 90, 90));
  frame.depth = cv::Mat::zeros(48, 64, CV_16UC1);
  frame.camera = {64, 48, 60.0, 60.0, 31.5, 23.5};
  return frame;
}

// A right message for every channel a node of ours listens to.
std::vector<Said> RightMessages() {
  std::vector<Said> said;
  messaging::Bus bus("memq://");
  bus.SetTap([&](const std::string& channel, const void* data, std::size_t size) {
    said.emplace_back(channel, Bytes(static_cast<const std::uint8_t*>(data), static_cast<const std::uint8_t*>(data) + size));
  });
  messaging::FrameSender(bus).Send(BlankFrame(kNow_us));

  messaging::MountState state;
  state.utime = kNow_us;
  said.push_back(Say(messaging::kMountState, messaging::ToMessage(state)));
  motion::Trajectory way;
  way.waypoints = {{0.0, geometry::Rigid::Identity()}, {1.0, geometry::Rigid::Identity()}};
  said.push_back(Say(messaging::kMountCommand, messaging::ToMessage(way, 5, kNow_us)));
  messaging::Track track;
  track.utime = kNow_us;
  track.object = "mug";
  said.push_back(Say(messaging::kLearnerTrack, messaging::ToMessage(track)));
  messaging::Scene scene;
  scene.utime = kNow_us;
  scene.object = "mug";
  scene.hulls.resize(1);
  scene.hulls[0].points_in_world = {{0.0, 0.0, 0.1}, {0.1, 0.0, 0.1}, {0.0, 0.1, 0.1}, {0.0, 0.0, 0.0}};
  said.push_back(Say(messaging::kLearnerScene, messaging::ToMessage(scene)));
  messaging::AddedView view;
  view.utime = kNow_us;
  view.object = "mug";
  view.views = 1;
  said.push_back(Say(messaging::kLearnerView, messaging::ToMessage(view)));
  messaging::ObjectMeasures measures;
  measures.utime = kNow_us;
  measures.object = "mug";
  said.push_back(Say(messaging::kAssessorMeasures, messaging::ToMessage(measures)));
  messaging::ObjectCompleteness completeness;
  completeness.utime = kNow_us;
  completeness.object = "mug";
  completeness.sphere = geometry::ViewSphere(4, 2);
  completeness.cells.assign(8, 0.5);
  said.push_back(Say(messaging::kAssessorCompleteness, messaging::ToMessage(completeness)));
  messaging::Reach reach;
  reach.utime = kNow_us;
  reach.object = "mug";
  reach.viewpoints.push_back({{Eigen::Vector3d::UnitX(), 0.5}, 1.0});
  said.push_back(Say(messaging::kPlannerReach, messaging::ToMessage(reach)));
  query_t query;
  query.utime = kNow_us;
  query.query_id = 3;
  query.object = "mug";
  query.frame = query_t::FRAME_OBJECT;
  query.T_frame_camera = messaging::ToMessage(geometry::Rigid::Identity());
  said.push_back(Say(messaging::kAssessorQuery, query));
  operator_command_t command;
  command.utime = kNow_us;
  command.process = "nobody";
  command.command = "pause";
  said.push_back(Say(messaging::kOperatorCommand, command));
  object_prior_t prior;
  prior.utime = kNow_us;
  prior.object = "mug";
  prior.probability = 0.5;
  said.push_back(Say(messaging::kObjectPrior, prior));
  return said;
}

void Put64(Bytes& bytes, std::size_t at, std::uint64_t value) {
  for (int i = 0; i < 8; ++i) bytes[at + static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(value >> (56 - 8 * i));
}

class Hostile : public ::testing::Test {
 protected:
  Hostile() : bus_("memq://", [this] { return now_us_; }) {
    for (const auto& said : RightMessages())
      EXPECT_EQ(messaging::WhyRefused(said.first, said.second.data(), said.second.size()), "");
  }

  void Publish(const std::string& channel, const Bytes& bytes) { bus_.PublishRaw(channel, bytes.data(), bytes.size()); }
  void Settle(messaging::Node& node) {
    for (int i = 0; i < 2; ++i) {
      bus_.Drain();
      node.RunStep();
    }
    now_us_ += 10000;
  }

  // Says everything that is wrong, on the channels the node listens to; true where nothing else came of it than counts.
  void Attack(messaging::Node& node, const std::vector<std::string>& channels) {
    std::mt19937 random(kSeed);
    const auto messages = RightMessages();
    int refused = 0;
    for (const auto& channel : channels) {
      SCOPED_TRACE(channel);
      const auto right = std::find_if(messages.begin(), messages.end(), [&](const Said& said) { return said.first == channel; });
      ASSERT_NE(right, messages.end());
      const std::int64_t before = node.bad();
      int wrong = 0;
      for (const auto& [other, bytes] : messages) {
        if (messaging::TypeOfChannel(other) == messaging::TypeOfChannel(channel)) continue;
        Publish(channel, bytes);
        ++wrong;
      }
      for (std::size_t size = 1; size<right->second.size(); size += right->second.size()> 2000 ? 97 : 1) {
        Publish(channel, Bytes(right->second.begin(), right->second.begin() + static_cast<std::ptrdiff_t>(size)));
        ++wrong;
      }
      Bytes longer = right->second;
      longer.resize(1 << 20);  // Rubbish behind it, and far more than a datagram holds.
      Publish(channel, longer);
      ++wrong;
      bus_.Drain();
      Settle(node);
      EXPECT_EQ(node.bad(), before + wrong);
      refused += wrong;

      // Numbers that are none and sizes without bound, wherever they come to lie; time that goes backwards.
      for (std::size_t at = 8; at + 8 <= right->second.size() && at < 400; at += 4) {
        for (const std::uint64_t value :
             {0x7FF8000000000000ull, 0x7FFFFFFFFFFFFFFFull, 0x8000000000000000ull, 0xFFFFFFFFFFFFFFFFull}) {
          Bytes absurd = right->second;
          Put64(absurd, at, value);
          Publish(channel, absurd);
        }
        Settle(node);
      }
      for (int i = 0; i < 300; ++i) {
        Bytes flipped = right->second;
        for (int flips = 1 + static_cast<int>(random() % 4); flips > 0; --flips) {
          flipped[8 + random() % (flipped.size() - 8)] ^= static_cast<std::uint8_t>(1u << random() % 8);
        }
        Publish(channel, flipped);
        if (i % 10 == 9) Settle(node);
      }
      Settle(node);
    }
    EXPECT_GT(node.bad(), refused);
    EXPECT_NE(node.last_error(), "");
    // The status says on which channel.
    status_t status;
    bus_.Subscribe<status_t>(messaging::StatusChannel(node.process()), [&](const status_t& m) { status = m; });
    node.PublishStatus();
    bus_.Drain();
    EXPECT_EQ(status.bad, node.bad());
    for (const auto& channel : channels) {
      const bool told = std::any_of(status.counters.begin(), status.counters.end(), [&](const counter_t& counter) {
        return counter.name == "bad " + channel && counter.total > 0;
      });
      EXPECT_TRUE(told) << channel;
    }
  }

  void SendFrame() {
    now_us_ += 2000000;
    messaging::FrameSender(bus_).Send(BlankFrame(now_us_));
  }

  testing::TemporaryFolder folder_;
  std::int64_t now_us_ = kNow_us;
  messaging::Bus bus_;
};

TEST_F(Hostile, Sensor) {
  class Blank : public sensor::FrameSource {
   public:
    std::optional<rgbd::Frame> Next(const std::optional<geometry::Rigid>&) override { return BlankFrame(0); }
    std::string Name() const override { return "blank"; }
  };
  sensor::SensorNode node(bus_, std::make_unique<Blank>(), {});
  Attack(node, {messaging::kMountState, messaging::kOperatorCommand});
  const auto frames = node.frames();
  now_us_ += 1000000;
  Settle(node);
  EXPECT_GT(node.frames(), frames);
}

TEST_F(Hostile, Mount) {
  mount::MountNode node(bus_, {});
  const geometry::Rigid before = node.state().T_world_mount;
  Attack(node, {messaging::kMountCommand, messaging::kOperatorCommand});
  now_us_ += 10000000;
  Settle(node);
  EXPECT_TRUE(node.state().T_world_mount.isApprox(before));  // It stands where it stood: no wrong way was driven.
}

TEST_F(Hostile, Learner) {
  learner::LearnerNodeParams params;
  params.store = folder_ / "models.db";
  learner::LearnerNode node(bus_, params);
  int tracks = 0;
  bus_.Subscribe<track_t>(messaging::kLearnerTrack, [&](const track_t&) { ++tracks; });
  Attack(node, {messaging::kSensorColor, messaging::kSensorDepth, messaging::kMountState, messaging::kAssessorMeasures,
                messaging::kOperatorCommand});
  // The mount said it moved in a far future; then it speaks the truth again.
  messaging::MountState state;
  for (const std::int64_t utime : {std::int64_t{4000000000000000}, now_us_}) {
    state.utime = utime;
    state.moving = utime != now_us_;
    const auto [channel, bytes] = Say(messaging::kMountState, messaging::ToMessage(state));
    Publish(channel, bytes);
  }
  tracks = 0;
  SendFrame();
  Settle(node);
  Settle(node);
  EXPECT_EQ(tracks, 1);
}

TEST_F(Hostile, Recogniser) {
  recogniser::RecogniserNodeParams params;
  params.store = folder_ / "models.db";
  recogniser::RecogniserNode node(bus_, params);
  int detections = 0;
  bus_.Subscribe<detections_t>(messaging::kRecogniserDetections, [&](const detections_t&) { ++detections; });
  Attack(node, {messaging::kSensorColor, messaging::kSensorDepth, messaging::kLearnerView, messaging::kObjectPrior});
  detections = 0;
  SendFrame();
  Settle(node);
  Settle(node);
  EXPECT_EQ(detections, 1);
}

TEST_F(Hostile, Assessor) {
  assessor::AssessorNodeParams params;
  params.store = folder_ / "models.db";
  assessor::AssessorNode node(bus_, params);
  int answers = 0;
  bus_.Subscribe<answer_t>(messaging::kAssessorAnswer, [&](const answer_t&) { ++answers; });
  Attack(node, {messaging::kSensorColor, messaging::kSensorDepth, messaging::kLearnerTrack, messaging::kLearnerView,
                messaging::kPlannerReach, messaging::kAssessorQuery});
  answers = 0;
  for (const auto& [channel, bytes] : RightMessages()) {
    if (channel == messaging::kAssessorQuery) Publish(channel, bytes);
  }
  Settle(node);
  Settle(node);
  EXPECT_EQ(answers, 1);
}

TEST_F(Hostile, Planner) {
  planner::PlannerNodeParams params;
  params.wait_s = 1e6;
  planner::PlannerNode node(bus_, params);
  std::string last_reason;
  bus_.Subscribe<plan_t>(messaging::kPlannerPlan, [&](const plan_t& plan) { last_reason = plan.stop_reason; });
  Attack(node, {messaging::kMountState, messaging::kLearnerTrack, messaging::kLearnerScene, messaging::kLearnerView,
                messaging::kAssessorMeasures, messaging::kAssessorCompleteness, messaging::kOperatorCommand});
  // What passes every check may still say that there is nothing to go for: then the run ends, by its name, and the process stays.
  EXPECT_FALSE(node.Finished());
  EXPECT_EQ(node.done(), !last_reason.empty());
}

}  // namespace
}  // namespace vantage
