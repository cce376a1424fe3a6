#include "messaging/planner_messages.h"

#include <gtest/gtest.h>

#include "messaging/bus.h"

namespace vantage::messaging {
namespace {

exploration::Decision DecisionAmong(int candidates) {
  exploration::Decision decision;
  for (int i = 0; i < candidates; ++i) {
    exploration::Candidate candidate;
    candidate.view.id = i;
    candidate.gain = 0.1;
    candidate.path.emplace();
    for (int k = 0; k < 100; ++k) {
      geometry::Rigid pose = geometry::Rigid::Identity();
      pose.translation().x() = 0.01 * k;
      candidate.path->waypoints.push_back({0.05 * k, pose});
    }
    decision.candidates.push_back(candidate);
  }
  decision.candidates[1].refusal = "in collision";
  decision.chosen = 0;
  return decision;
}

TEST(PlannerMessages, ADecisionSaysWhatItWasMadeOf) {
  PlanStatus status;
  status.state = "moving";
  status.command_id = 5;
  const auto decision = DecisionAmong(60);
  const plan_t message = ToMessage(status, &decision);
  EXPECT_EQ(message.chosen, 0);
  ASSERT_EQ(message.count, 60);
  EXPECT_EQ(message.candidates[1].refusal, "in collision");
  ASSERT_EQ(message.candidates[0].count, 12);
  EXPECT_FLOAT_EQ(message.candidates[0].path[0][0], 0.f);
  EXPECT_FLOAT_EQ(message.candidates[0].path[11][0], 0.99f);
  EXPECT_LT(message.getEncodedSize(), kMaxMessageBytes);
}

TEST(PlannerMessages, PathsAreLeftOutBeforeTheMessageGrowsTooLarge) {
  const auto decision = DecisionAmong(700);
  const plan_t message = ToMessage(PlanStatus(), &decision);
  EXPECT_LT(message.getEncodedSize(), kMaxMessageBytes);
  EXPECT_EQ(message.count, 700);
  EXPECT_EQ(message.candidates[0].count, 0);
}

TEST(PlannerMessages, NoDecisionYet) {
  const plan_t message = ToMessage(PlanStatus(), nullptr);
  EXPECT_EQ(message.chosen, -1);
  EXPECT_EQ(message.count, 0);
}

}  // namespace
}  // namespace vantage::messaging
