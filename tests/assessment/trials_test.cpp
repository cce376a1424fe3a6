#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "assessment/assessor.h"
#include "assessment/board.h"
#include "assessment/virtual_object.h"

namespace vantage::assessment {
namespace {

constexpr double kDegree = M_PI / 180.0;

// Four views of the box from all round, and what is behind it.
class BoardTrials : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    VANTAGE_NEEDS_DATA("board");
    const vantage::testing::Board board;
    for (int id : {0, 40, 80, 120}) {
      board.AddView(id, recogniser_.features, &object_);
      backgrounds_.push_back({WithoutObject(board.scene.Load(id).color, board.Mask(id)), nullptr});
    }
  }
  void SetUp() override {
    VANTAGE_NEEDS_DATA("board");
    ASSERT_GE(object_.views.size(), 3u);
  }

  static inline const recognition::RecogniserParams recogniser_;
  static inline model::ObjectModel object_;
  static inline std::vector<Background> backgrounds_;
};

bool Same(const std::vector<Proposal>& a, const std::vector<Proposal>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Proposal& one, const Proposal& other) {
    return one.confidence == other.confidence && one.correct == other.correct;
  });
}

bool Same(const Trial& a, const Trial& b) {
  return a.view == b.view && a.object_shown == b.object_shown && a.rotation_rad == b.rotation_rad && a.log2_scale == b.log2_scale &&
         Same(a.alone, b.alone) && Same(a.together, b.together);
}

TEST_F(BoardTrials, TheBoxTeachesItsOwnMeasures) {
  TrialParams params;
  params.trials_per_view = 32;
  params.negatives_per_view = 4;
  const std::vector<Trial> trials = RunTrials(object_, 0, &backgrounds_, recogniser_, params);
  ASSERT_EQ(trials.size(), object_.views.size() * 36);

  int near = 0, near_right = 0, far = 0, far_right = 0, without_right = 0;
  double right_confidence = 0.0, wrong_confidence = 0.0;
  int right = 0, wrong = 0;
  for (const Trial& trial : trials) {
    if (trial.hypothesis()) (trial.correct() ? right : wrong) += 1;
    if (trial.hypothesis()) (trial.correct() ? right_confidence : wrong_confidence) += trial.confidence();
    if (!trial.object_shown) without_right += trial.correct();
    if (!trial.object_shown) continue;
    const bool as_learned = std::abs(trial.log2_scale) < 0.5;
    if (trial.rotation_rad < 15 * kDegree && as_learned) near += 1, near_right += trial.correct();
    if (trial.rotation_rad > 45 * kDegree) far += 1, far_right += trial.correct();
  }
  EXPECT_EQ(without_right, 0);
  ASSERT_GE(near, 10);
  EXPECT_GT(near_right, 0.85 * near) << near;
  EXPECT_LT(far_right, 0.75 * far) << far;
  ASSERT_GT(right, 0);
  ASSERT_GT(wrong, 0);

  const measures::Measures measures = FitMeasures(trials, recogniser_);
  EXPECT_GT(measures.predicted.HalfwayRotation(), 12.0 * kDegree);
  EXPECT_LT(measures.predicted.HalfwayRotation(), 45.0 * kDegree);
  EXPECT_GT(measures.observed.Probability(right_confidence / right), 0.75);
  EXPECT_LT(measures.observed.Probability(wrong_confidence / wrong), 0.35);
}

TEST_F(BoardTrials, AreTheSameAgainAndViewByView) {
  TrialParams params;
  params.trials_per_view = 3;
  params.negatives_per_view = 1;
  params.seed = 5;
  int calls = 0;
  const auto progress = [&calls](int done, int of) {
    ++calls;
    EXPECT_LE(done, of);
  };
  const std::vector<Trial> all = RunTrials(object_, 0, &backgrounds_, recogniser_, params, progress);
  EXPECT_EQ(calls, static_cast<int>(all.size()));
  const int last_view = static_cast<int>(object_.views.size()) - 1;
  const std::vector<Trial> last = RunTrials(object_, last_view, &backgrounds_, recogniser_, params);
  ASSERT_EQ(last.size(), 4u);
  for (std::size_t i = 0; i < last.size(); ++i) EXPECT_TRUE(Same(last[i], all[all.size() - 4 + i])) << i;
  // In parts: every third, from each of the first three on.
  std::size_t in_parts = 0;
  for (int part = 0; part < 3; ++part) {
    const std::vector<Trial> some = RunTrials(object_, last_view, &backgrounds_, recogniser_, params, {}, {part, 3});
    for (std::size_t i = 0; i < some.size(); ++i)
      EXPECT_TRUE(Same(some[i], last.at(static_cast<std::size_t>(part) + 3 * i))) << part;
    in_parts += some.size();
  }
  EXPECT_EQ(in_parts, last.size());
  params.seed = 6;
  EXPECT_FALSE(Same(RunTrials(object_, last_view, &backgrounds_, recogniser_, params)[0], last[0]));
  EXPECT_TRUE(RunTrials(object_, last_view + 1, &backgrounds_, recogniser_, params).empty());
}

TEST_F(BoardTrials, NoBackgroundIsANegativeTwice) {
  TrialParams params;
  params.trials_per_view = 1;
  params.negatives_per_view = 9;
  const std::vector<Trial> trials = RunTrials(object_, 2, &backgrounds_, recogniser_, params);
  const auto negative = [](const Trial& trial) { return !trial.object_shown; };
  EXPECT_EQ(std::count_if(trials.begin(), trials.end(), negative),
            static_cast<long>((object_.views.size() - 2) * backgrounds_.size()));
}

TEST_F(BoardTrials, WhatIsHiddenIsFoundLessOften) {
  TrialParams params;
  params.trials_per_view = 24;
  params.negatives_per_view = 0;
  params.max_rotation_deg = 25.0;
  const auto right = [&] {
    const auto trials = RunTrials(object_, 2, &backgrounds_, recogniser_, params);
    return std::count_if(trials.begin(), trials.end(), [](const Trial& trial) { return trial.correct(); });
  };
  const auto whole = right();
  params.max_occlusion = 0.99;
  EXPECT_LT(right(), 0.9 * static_cast<double>(whole));
}

TEST_F(BoardTrials, InOtherLightItIsFoundLessSurely) {
  TrialParams params;
  params.trials_per_view = 24;
  params.negatives_per_view = 0;
  params.max_rotation_deg = 25.0;
  const auto confidence = [&](double lamp_share) {
    params.lamp_share = lamp_share;
    double sum = 0.0;
    for (const Trial& trial : RunTrials(object_, 2, &backgrounds_, recogniser_, params)) sum += trial.confidence();
    return sum;
  };
  const double as_learned = confidence(0.0);
  EXPECT_GT(confidence(0.01), 0.95 * as_learned);
  EXPECT_LT(confidence(0.95), 0.85 * as_learned);
}

TEST_F(BoardTrials, ALookAlikeIsOneMoreNegative) {
  const cv::Mat plain = backgrounds_[0].color;
  const cv::Mat with = WithLookAlike(plain, object_, 3);
  EXPECT_EQ(with.size(), plain.size());
  EXPECT_GT(cv::norm(with, plain, cv::NORM_L1), 0.0);
  EXPECT_EQ(cv::norm(with, WithLookAlike(plain, object_, 3), cv::NORM_INF), 0.0);
  EXPECT_GT(cv::norm(with, WithLookAlike(plain, object_, 4), cv::NORM_INF), 0.0);
  EXPECT_EQ(cv::norm(plain, WithLookAlike(plain, model::ObjectModel(), 3), cv::NORM_INF), 0.0);
  // Of all look-alikes the object itself is the worst: it is proposed with a confidence that no background reaches, and that is
  // wrong.
  std::vector<Background> backgrounds = {{plain, nullptr}, {with, nullptr}};  // Tried in turn.
  TrialParams params;
  params.trials_per_view = 1;
  params.negatives_per_view = 2;
  const auto trials = RunTrials(object_, static_cast<int>(object_.views.size()) - 1, &backgrounds, recogniser_, params);
  ASSERT_EQ(trials.size(), 3u);
  const auto confidence = [](const Trial& trial) { return trial.together.empty() ? 0.0 : trial.together.front().confidence; };
  EXPECT_GT(confidence(trials[2]), confidence(trials[1]) + 0.1);
  EXPECT_FALSE(trials[2].together.front().correct);
  EXPECT_TRUE(backgrounds[1].features);
}

TEST_F(BoardTrials, WithoutBackgroundsTheyStillRun) {
  TrialParams params;
  params.trials_per_view = 4;
  params.negatives_per_view = 1;
  params.max_rotation_deg = 10.0;
  params.max_image_noise = 4.0;
  int right = 0;
  std::vector<Background> none;
  for (const Trial& trial : RunTrials(object_, 2, &none, recogniser_, params)) right += trial.correct();
  EXPECT_GE(right, 3);
}

}  // namespace
}  // namespace vantage::assessment
