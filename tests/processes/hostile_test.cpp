// A bus on which somebody says what is wrong: other types, messages cut off, absurd sizes, values that are no numbers, time that
// goes backwards, bits that flip. Every node counts, warns, and goes on.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <memory>
#include <random>
#include <vantage/answer_t.hpp>
#include <vantage/object_prior_t.hpp>
#include <vantage/operator_command_t.hpp>
#include <vantage/query_t.hpp>
#include <vantage/status_t.hpp>

#include "assessor/node.h"
#include "learner/node.h"
#include "messaging/channels.h"
#include "messaging/geometry_messages.h"
#include "messaging/known_types.h"
#include "mount/node.h"
#include "planner/node.h"
#include "processes/blank_frame.h"
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

// The camera looks at the mug on the table's middle, from where it may set out.
geometry::Rigid Stand() { return geometry::LookAt({0.5, 0.1, 0.4}, {0.0, 0.0, 0.05}, Eigen::Vector3d::UnitZ()); }

// A right message for every channel a node of ours listens to, at this time.
std::vector<Said> RightMessages(std::int64_t utime = kNow_us) {
  std::vector<Said> said;
  messaging::Bus bus("memq://");
  bus.SetTap([&](const std::string& channel, const void* data, std::size_t size) {
    said.emplace_back(channel, Bytes(static_cast<const std::uint8_t*>(data), static_cast<const std::uint8_t*>(data) + size));
  });
  messaging::FrameSender(bus).Send(testing::BlankFrame(utime));

  messaging::MountState state;
  state.utime = utime;
  state.T_world_mount = Stand();
  said.push_back(Say(messaging::kMountState, messaging::ToMessage(state)));
  motion::Trajectory way;
  way.waypoints = {{0.0, geometry::Rigid::Identity()}, {1.0, geometry::Rigid::Identity()}};
  said.push_back(Say(messaging::kMountCommand, messaging::ToMessage(way, 5, utime)));
  messaging::Track track;
  track.utime = utime;
  track.object = "mug";
  track.T_world_object = geometry::Rigid::Identity();
  said.push_back(Say(messaging::kLearnerTrack, messaging::ToMessage(track)));
  messaging::Scene scene;
  scene.utime = utime;
  scene.object = "mug";
  scene.hulls.resize(1);
  scene.hulls[0].points_in_world = {{0.0, 0.0, 0.1}, {0.1, 0.0, 0.1}, {0.0, 0.1, 0.1}, {0.0, 0.0, 0.0}};
  said.push_back(Say(messaging::kLearnerScene, messaging::ToMessage(scene)));
  messaging::AddedView view;
  view.utime = utime;
  view.object = "mug";
  view.views = 1;
  said.push_back(Say(messaging::kLearnerView, messaging::ToMessage(view)));
  messaging::ObjectMeasures measures;
  measures.utime = utime;
  measures.object = "mug";
  measures.views = 1;
  said.push_back(Say(messaging::kAssessorMeasures, messaging::ToMessage(measures)));
  messaging::ObjectCompleteness completeness;
  completeness.utime = utime;
  completeness.object = "mug";
  completeness.sphere = geometry::ViewSphere(4, 2);
  completeness.cells.assign(8, 0.5);
  said.push_back(Say(messaging::kAssessorCompleteness, messaging::ToMessage(completeness)));
  messaging::Reach reach;
  reach.utime = utime;
  reach.object = "mug";
  reach.viewpoints.push_back({{Eigen::Vector3d::UnitX(), 0.5}, 1.0});
  said.push_back(Say(messaging::kPlannerReach, messaging::ToMessage(reach)));
  query_t query;
  query.utime = utime;
  query.query_id = 3;
  query.object = "mug";
  query.frame = query_t::FRAME_OBJECT;
  query.T_frame_camera = messaging::ToMessage(geometry::Rigid::Identity());
  said.push_back(Say(messaging::kAssessorQuery, query));
  operator_command_t command;
  command.utime = utime;
  command.process = "nobody";
  command.command = "pause";
  said.push_back(Say(messaging::kOperatorCommand, command));
  object_prior_t prior;
  prior.utime = utime;
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

  // ...and then it does its work: it answers what `ask` says with one message.
  template <typename Answer>
  void AttackThenAsk(messaging::Node& node, const std::vector<std::string>& channels, const std::string& answering,
                     const std::function<void()>& ask) {
    const auto answers = std::make_shared<int>(0);
    bus_.Subscribe<Answer>(answering, [answers](const Answer&) { ++*answers; });
    Attack(node, channels);
    *answers = 0;
    ask();
    Settle(node);
    Settle(node);
    EXPECT_EQ(*answers, 1);
  }

  template <typename NodeParams>
  NodeParams WithStore() const {
    NodeParams params;
    params.store = folder_ / "models.db";
    return params;
  }

  void SendFrame() {
    now_us_ += 2000000;
    messaging::FrameSender(bus_).Send(testing::BlankFrame(now_us_));
  }

  testing::TemporaryFolder folder_;
  std::int64_t now_us_ = kNow_us;
  messaging::Bus bus_;
};

TEST_F(Hostile, Sensor) {
  class Blank : public sensor::FrameSource {
   public:
    std::optional<rgbd::Frame> Next(const std::optional<geometry::Rigid>&) override { return testing::BlankFrame(0); }
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
  learner::LearnerNode node(bus_, WithStore<learner::LearnerNodeParams>());
  const std::vector<std::string> channels = {messaging::kSensorColor, messaging::kSensorDepth, messaging::kMountState,
                                             messaging::kAssessorMeasures, messaging::kOperatorCommand};
  AttackThenAsk<track_t>(node, channels, messaging::kLearnerTrack, [this] {
    // The mount said it moved in a far future; then it speaks the truth again.
    messaging::MountState state;
    for (const std::int64_t utime : {std::int64_t{4000000000000000}, now_us_}) {
      state.utime = utime;
      state.moving = utime != now_us_;
      const auto [channel, bytes] = Say(messaging::kMountState, messaging::ToMessage(state));
      Publish(channel, bytes);
    }
    SendFrame();
  });
}

TEST_F(Hostile, Recogniser) {
  recogniser::RecogniserNode node(bus_, WithStore<recogniser::RecogniserNodeParams>());
  AttackThenAsk<detections_t>(node,
                              {messaging::kSensorColor, messaging::kSensorDepth, messaging::kLearnerView, messaging::kObjectPrior},
                              messaging::kRecogniserDetections, [this] { SendFrame(); });
}

TEST_F(Hostile, Assessor) {
  assessor::AssessorNode node(bus_, WithStore<assessor::AssessorNodeParams>());
  const std::vector<std::string> channels = {messaging::kSensorColor, messaging::kSensorDepth,  messaging::kLearnerTrack,
                                             messaging::kLearnerView, messaging::kPlannerReach, messaging::kAssessorQuery};
  AttackThenAsk<answer_t>(node, channels, messaging::kAssessorAnswer, [this] {
    for (const auto& [channel, bytes] : RightMessages()) {
      if (channel == messaging::kAssessorQuery) Publish(channel, bytes);
    }
  });
}

// Nothing it is told leads it to send the mount on a way that is none, and once the truth is said again it goes on from there.
TEST_F(Hostile, Planner) {
  planner::PlannerNodeParams params;
  params.wait_s = 1e6;
  planner::PlannerNode node(bus_, params);
  std::vector<messaging::Result<motion::Trajectory>> ways;
  bus_.Subscribe<mount_command_t>(messaging::kMountCommand,
                                  [&](const mount_command_t& message) { ways.push_back(messaging::FromMessage(message)); });
  Attack(node, {messaging::kMountState, messaging::kLearnerTrack, messaging::kLearnerScene, messaging::kLearnerView,
                messaging::kAssessorMeasures, messaging::kAssessorCompleteness, messaging::kOperatorCommand});
  EXPECT_FALSE(node.Finished());
  EXPECT_FALSE(node.done()) << node.status().stop_reason;
  for (const auto& way : ways) EXPECT_TRUE(way) << way.error;

  ways.clear();
  const auto telling = {messaging::kMountState, messaging::kLearnerTrack, messaging::kLearnerScene, messaging::kAssessorMeasures};
  for (int i = 0; i < 1000 && ways.empty(); ++i) {
    now_us_ += 100000;
    for (const auto& [channel, bytes] : RightMessages(now_us_)) {
      if (std::find(telling.begin(), telling.end(), channel) != telling.end()) Publish(channel, bytes);
    }
    Settle(node);
  }
  ASSERT_FALSE(ways.empty()) << node.status().state << " " << node.status().stop_reason << " " << node.last_error();
  ASSERT_TRUE(ways.front()) << ways.front().error;
  ASSERT_FALSE(ways.front()->waypoints.empty());
  EXPECT_TRUE(ways.front()->waypoints.front().T_world_mount.isApprox(Stand(), 1e-6));
}

}  // namespace
}  // namespace vantage
