// What nodes make of messages that are wrong, and of inputs that never come.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <vantage/answer_t.hpp>
#include <vantage/object_prior_t.hpp>
#include <vantage/operator_command_t.hpp>
#include <vantage/query_t.hpp>

#include "assessor/node.h"
#include "learner/node.h"
#include "messaging/channels.h"
#include "messaging/geometry_messages.h"
#include "messaging/run_loop.h"
#include "planner/node.h"
#include "processes/blank_frame.h"
#include "recogniser/node.h"
#include "sensor/node.h"
#include "support/folder.h"

namespace vantage {
namespace {

// Lets every node deal with what is on the bus.
void Settle(messaging::Bus& bus, messaging::Node& node) {
  for (int i = 0; i < 3; ++i) {
    bus.Drain();
    node.RunStep();
  }
}

void PublishRubbish(messaging::Bus& bus) {
  for (const char* channel : {messaging::kSensorColor, messaging::kSensorDepth, messaging::kMountState, messaging::kMountCommand,
                              messaging::kLearnerTrack, messaging::kLearnerScene, messaging::kLearnerView,
                              messaging::kAssessorMeasures, messaging::kAssessorCompleteness, messaging::kAssessorQuery,
                              messaging::kPlannerReach, messaging::kOperatorCommand, messaging::kObjectPrior}) {
    bus.PublishRaw(channel, "rubbish", 7);
    const std::string long_rubbish(5000, '\xff');
    bus.PublishRaw(channel, long_rubbish.data(), long_rubbish.size());
  }
}

TEST(BadInput, LearnerCountsRubbishAndGoesOn) {
  const testing::TemporaryFolder folder;
  messaging::Bus bus("memq://");
  learner::LearnerNodeParams params;
  params.store = folder / "models.db";
  learner::LearnerNode node(bus, params);
  std::vector<track_t> tracks;
  bus.Subscribe<track_t>(messaging::kLearnerTrack, [&](const track_t& m) { tracks.push_back(m); });
  PublishRubbish(bus);
  Settle(bus, node);
  EXPECT_EQ(node.bad(), 10);  // Two on each of the five channels it listens to.
  EXPECT_NE(node.last_error(), "");
  messaging::FrameSender(bus).Send(testing::BlankFrame(bus.now_us(), 160, 120));
  Settle(bus, node);
  bus.Drain();
  ASSERT_EQ(tracks.size(), 1u);
  EXPECT_EQ(tracks[0].state, "searching");
  EXPECT_NE(tracks[0].note, "");

  // A store that is none.
  std::ofstream(folder / "text.db") << "this is no database, however long it may get to be, sixteen bytes at least";
  params.store = folder / "text.db";
  try {
    learner::LearnerNode another(bus, params);
    FAIL() << "accepted";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("text.db"), std::string::npos) << error.what();
  }
}

TEST(BadInput, RecogniserWithoutAStoreFindsNothingAndRefusesPriorsThatAreNone) {
  const testing::TemporaryFolder folder;
  messaging::Bus bus("memq://");
  recogniser::RecogniserNodeParams params;
  params.store = folder / "later.db";
  recogniser::RecogniserNode node(bus, params);
  std::vector<detections_t> heard;
  bus.Subscribe<detections_t>(messaging::kRecogniserDetections, [&](const detections_t& m) { heard.push_back(m); });
  PublishRubbish(bus);
  object_prior_t prior;
  prior.utime = 1;
  prior.object = "mug";
  prior.probability = std::nan("");
  bus.Publish(messaging::kObjectPrior, prior);
  Settle(bus, node);
  EXPECT_EQ(node.bad(), 1 + 8);  // The prior, and two on each of the four channels it listens to.
  messaging::FrameSender(bus).Send(testing::BlankFrame(bus.now_us(), 160, 120));
  Settle(bus, node);
  bus.Drain();
  ASSERT_EQ(heard.size(), 1u);
  EXPECT_EQ(heard[0].objects, 0);
  EXPECT_FALSE(std::filesystem::exists(params.store));
}

TEST(BadInput, AssessorSaysWhyItCannotAnswer) {
  const testing::TemporaryFolder folder;
  messaging::Bus bus("memq://");
  assessor::AssessorNodeParams params;
  params.store = folder / "later.db";
  assessor::AssessorNode node(bus, params);
  std::vector<answer_t> answers;
  bus.Subscribe<answer_t>(messaging::kAssessorAnswer, [&](const answer_t& m) { answers.push_back(m); });
  PublishRubbish(bus);
  query_t query;
  query.utime = 1;
  query.query_id = 1;
  query.object = "mug";
  query.frame = query_t::FRAME_OBJECT;
  query.T_frame_camera = messaging::ToMessage(geometry::Rigid::Identity());
  bus.Publish(messaging::kAssessorQuery, query);
  query.query_id = 2;
  query.T_frame_camera.position[0] = std::nan("");
  bus.Publish(messaging::kAssessorQuery, query);
  Settle(bus, node);
  bus.Drain();
  ASSERT_EQ(answers.size(), 2u);
  EXPECT_FALSE(answers[0].known);
  EXPECT_NE(answers[0].error.find("mug"), std::string::npos);
  EXPECT_FALSE(answers[1].known);
  EXPECT_NE(answers[1].error.find("finite"), std::string::npos);

  // A view is told of, but there is no store: an error that says what to do, not a crash.
  messaging::AddedView view;
  view.object = "mug";
  view.views = 1;
  bus.Publish(messaging::kLearnerView, messaging::ToMessage(view));
  Settle(bus, node);
  EXPECT_NE(node.last_error().find("--store"), std::string::npos) << node.last_error();
}

TEST(BadInput, PlannerWaitsForWhatIsMissingAndGivesUpWithAWord) {
  std::int64_t now_us = 1000000;
  messaging::Bus bus("memq://", [&] { return now_us; });
  planner::PlannerNodeParams params;
  params.wait_s = 10.0;
  planner::PlannerNode node(bus, params);
  PublishRubbish(bus);
  messaging::MountState state;
  auto message = messaging::ToMessage(state);
  message.T_world_mount.position[2] = std::nan("");
  bus.Publish(messaging::kMountState, message);
  Settle(bus, node);
  EXPECT_EQ(node.status().state, "waiting");
  EXPECT_GE(node.bad(), 1);
  now_us += 11000000;
  Settle(bus, node);
  EXPECT_TRUE(node.done());
  EXPECT_EQ(node.status().stop_reason, "nothing_to_explore");
  EXPECT_EQ(node.status().attempts, 0);
}

TEST(BadInput, PlannerStopsWhenTheOperatorSaysSo) {
  messaging::Bus bus("memq://");
  planner::PlannerNode node(bus, {});
  operator_command_t stop;
  stop.utime = 1;
  stop.command = "stop";
  stop.process = "mount";
  bus.Publish(messaging::kOperatorCommand, stop);
  Settle(bus, node);
  EXPECT_FALSE(node.done());
  stop.process = "";
  bus.Publish(messaging::kOperatorCommand, stop);
  Settle(bus, node);
  EXPECT_TRUE(node.done());
  EXPECT_EQ(node.status().stop_reason, "operator");
}

}  // namespace
}  // namespace vantage
