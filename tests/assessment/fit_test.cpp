#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "assessment/assessor.h"
#include "geometry/view_sphere.h"

namespace vantage::assessment {
namespace {

constexpr double kDegree = M_PI / 180.0;

// Found up to 30 degrees, proposed wrongly up to 45, not at all beyond; and some images without the object.
std::vector<Trial> MadeUpTrials(int count) {
  std::mt19937 random(11);
  std::normal_distribution<double> right(0.6, 0.08), wrong(0.15, 0.04);
  std::vector<Trial> trials;
  for (int i = 0; i < count; ++i) {
    Trial trial;
    const double angle = 60.0 * (i + 0.5) / count;
    trial.rotation_rad = angle * kDegree;
    const bool correct = angle < 30.0;
    if (angle < 45.0) trial.alone.push_back({correct ? right(random) : wrong(random), correct});
    trial.together = trial.alone;
    trials.push_back(trial);
  }
  for (int i = 0; i < count / 4; ++i) {
    Trial trial;
    trial.object_shown = false;
    if (i % 3 == 0) trial.together.push_back({wrong(random), false});
    trials.push_back(trial);
  }
  return trials;
}

TEST(FitMeasures, FindsWhatTheTrialsWereMadeOf) {
  const recognition::RecogniserParams recogniser;
  const measures::Measures measures = FitMeasures(MadeUpTrials(800), recogniser);
  EXPECT_NEAR(measures.observed.positive().mean, 0.6, 0.03);
  EXPECT_NEAR(measures.observed.negative().mean, 0.15, 0.03);
  // 200 wrong proposals with the object, 67 without; a trial without a proposal is no sample.
  EXPECT_EQ(measures.observed.positive().count, 400);
  EXPECT_EQ(measures.observed.negative().count, 267);
  // Trials without a proposal are failures of p(o|theta); images without the object are no trials of it.
  EXPECT_EQ(measures.predicted.trials(), 800);
  EXPECT_NEAR(measures.predicted.HalfwayRotation(), 30.0 * kDegree, 3.0 * kDegree);
  EXPECT_LT(measures.predicted.Probability(55.0 * kDegree), 0.05);
  EXPECT_EQ(measures.observed.source(), measures::Source::kOwn);
  EXPECT_EQ(measures.predicted.source(), measures::Source::kOwn);
  EXPECT_EQ(measures.fingerprint, recogniser.Fingerprint());
}

TEST(FitMeasures, RightButUnbelievedIsNotDetected) {
  std::vector<Trial> trials = MadeUpTrials(800);
  for (Trial& trial : trials) {
    if (trial.correct() && trial.rotation_rad > 15.0 * kDegree) trial.alone.front().confidence = 0.12;  // As low as wrong ones.
  }
  EXPECT_LT(FitMeasures(trials, {}).predicted.HalfwayRotation(), 20.0 * kDegree);
}

TEST(FitMeasures, LessLikelyProposalsAreSamplesToo) {
  std::vector<Trial> trials = MadeUpTrials(400);
  const int before = FitMeasures(trials, {}).observed.negative().count;
  for (int i = 0; i < 50; ++i) trials[static_cast<std::size_t>(i)].together.push_back({0.1, false});
  const measures::Measures measures = FitMeasures(trials, {});
  EXPECT_EQ(measures.observed.negative().count, before + 50);
  EXPECT_EQ(measures.predicted.trials(), 400);
}

TEST(FitMeasures, ConfidenceIsThatOfWholeModelsPredictionThatOfViewsAlone) {
  std::vector<Trial> trials = MadeUpTrials(800);
  const measures::Measures before = FitMeasures(trials, {});
  for (Trial& trial : trials) {
    if (!trial.object_shown) continue;
    trial.together.assign(1, {0.8, true});  // Another view knows better.
  }
  const measures::Measures measures = FitMeasures(trials, {});
  EXPECT_GT(measures.observed.positive().mean, 0.75);
  EXPECT_EQ(measures.observed.positive().count, 800);
  EXPECT_LE(measures.predicted.HalfwayRotation(), before.predicted.HalfwayRotation() + 1e-9);
}

TEST(FitMeasures, WhatViewsDoTogetherTellsHowFarTheyFailTogether) {
  std::vector<Trial> trials = MadeUpTrials(400);
  for (Trial& trial : trials) {
    if (trial.object_shown) trial.others.assign(8, {trial.rotation_rad, trial.log2_scale});
  }
  const double together = FitMeasures(trials, {}).predicted.common_cause();  // Nine views do no better than one.
  EXPECT_GT(together, 0.8);
  for (Trial& trial : trials) {
    if (trial.object_shown && trial.rotation_rad < 45.0 * kDegree) trial.together.assign(1, {0.6, true});
  }
  EXPECT_LT(FitMeasures(trials, {}).predicted.common_cause(), together - 0.3);
}

TEST(FitMeasures, NoTrialsGiveTheDefault) {
  const measures::Measures measures = FitMeasures({}, {});
  EXPECT_EQ(measures.observed.source(), measures::Source::kDefault);
  EXPECT_EQ(measures.predicted.source(), measures::Source::kDefault);
  EXPECT_TRUE(measures.fingerprint.empty());
}

TEST(TrialParams, NamesTheFieldOutOfRange) {
  EXPECT_NO_THROW(TrialParams().Check());
  TrialParams params;
  params.max_rotation_deg = 120.0;
  try {
    params.Check();
    FAIL() << "expected an exception";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("max_rotation_deg"), std::string::npos);
  }
}

TEST(MedianDistance, IsTheMiddleOneInAnyOrder) {
  const auto at = [](double distance_m) { return measures::Viewpoint{Eigen::Vector3d::UnitX(), distance_m}; };
  EXPECT_EQ(MedianDistance({}), 1.0);
  EXPECT_EQ(MedianDistance({at(0.9), at(0.4), at(0.5)}), 0.5);
  EXPECT_EQ(MedianDistance({at(0.9), at(0.4), at(0.5), at(0.6)}), 0.6);
}

TEST(UniformViewpoints, CoverTheBandEvenly) {
  const auto viewpoints = UniformViewpoints(10.0 * kDegree, 60.0 * kDegree, {0.5, 0.8}, 400);
  ASSERT_EQ(viewpoints.size(), 800u);
  double total = 0.0, low = 0.0;
  for (const auto& [viewpoint, weight] : viewpoints) {
    const double elevation = geometry::Elevation(viewpoint.direction);
    EXPECT_GT(elevation, 10.0 * kDegree);
    EXPECT_LT(elevation, 60.0 * kDegree);
    EXPECT_NEAR(viewpoint.direction.norm(), 1.0, 1e-9);
    total += weight;
    if (elevation < 30.0 * kDegree) low += weight;
  }
  EXPECT_NEAR(total, 1.0, 1e-9);
  const double share = (std::sin(30 * kDegree) - std::sin(10 * kDegree)) / (std::sin(60 * kDegree) - std::sin(10 * kDegree));
  EXPECT_NEAR(low, share, 0.01);
  EXPECT_THROW(UniformViewpoints(0.5, 0.5, {1.0}), std::invalid_argument);
  EXPECT_THROW(UniformViewpoints(0.1, 0.5, {}), std::invalid_argument);
}

}  // namespace
}  // namespace vantage::assessment
