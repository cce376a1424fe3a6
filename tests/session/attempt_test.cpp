#include "session/attempt.h"

#include <gtest/gtest.h>

namespace vantage::session {
namespace {

using learning::State;

exploration::Attempt Of(State state, double probability, double confidence) {
  learning::LearnerResult seen;
  seen.state = state;
  seen.probability = probability;
  seen.confidence.value = confidence;
  seen.note = "no cluster where the object is";
  exploration::Attempt attempt;
  NoteFrame(seen, {0.7, 0.6}, attempt);
  return attempt;
}

TEST(Attempt, IsWellKnownOnlyWhereTheLearnerIsConfident) {
  EXPECT_TRUE(Of(State::kTracking, 0.7, 0.6).well_known);
  EXPECT_TRUE(Of(State::kTracking, 0.7, 0.6).detected);
  EXPECT_FALSE(Of(State::kTracking, 0.9, 0.59).well_known) << "another reason than confidence";
  EXPECT_TRUE(Of(State::kTracking, 0.9, 0.59).detected);
  for (const auto& attempt : {Of(State::kTracking, 0.69, 0.9), Of(State::kRelocalising, 0.9, 0.9), Of(State::kLost, 0.9, 0.9)}) {
    EXPECT_FALSE(attempt.detected);
    EXPECT_FALSE(attempt.well_known);
  }
}

TEST(Attempt, OneFrameIsEnough) {
  exploration::Attempt attempt = Of(State::kTracking, 0.9, 0.7);
  NoteFrame({}, {}, attempt);
  EXPECT_TRUE(attempt.detected);
  EXPECT_TRUE(attempt.well_known);
}

}  // namespace
}  // namespace vantage::session
