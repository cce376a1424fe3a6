#include "measures/predicted.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace vantage::measures {
namespace {

constexpr double kDegree = M_PI / 180.0;

// Detected with a probability that falls from 1 to 0 around `halfway_deg`.
std::vector<PredictionSample> Samples(int count, double halfway_deg, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> rotation(0.0, 60.0), scale(-1.0, 1.0), chance(0.0, 1.0);
  std::vector<PredictionSample> samples;
  for (int i = 0; i < count; ++i) {
    const double angle = rotation(random);
    samples.push_back({angle * kDegree, scale(random), chance(random) < 1.0 / (1.0 + std::exp((angle - halfway_deg) / 4.0))});
  }
  return samples;
}

void ExpectNonIncreasingAndBounded(const PredictedSuccess& predicted) {
  for (double scale = -2.5; scale <= 2.5; scale += 0.125) {
    double last = 1.0;
    for (double angle = 0.0; angle <= 180.0; angle += 0.5) {
      const double p = predicted.Probability(angle * kDegree, scale);
      ASSERT_GE(p, 0.0);
      ASSERT_LE(p, last + 1e-12) << angle << " degrees, scale " << scale;
      last = p;
    }
    ASSERT_EQ(predicted.Probability(M_PI_2, scale), 0.0);
  }
}

TEST(Predicted, TheDefaultFallsToOneHalfWhereThePhotographsDid) {
  const PredictedSuccess predicted;
  EXPECT_EQ(predicted.source(), Source::kDefault);
  EXPECT_EQ(predicted.trials(), 0);
  EXPECT_NEAR(predicted.HalfwayRotation(), 27.0 * kDegree, 2.0 * kDegree);
  EXPECT_GT(predicted.Probability(0.0), 0.95);
  EXPECT_NEAR(predicted.Probability(0.0, 1.0) / predicted.Probability(0.0), 2.0 / 3.0, 0.05);
  ExpectNonIncreasingAndBounded(predicted);
}

TEST(Predicted, IsContinuous) {
  const PredictedSuccess predicted = PredictedSuccess::Fit(Samples(500, 30.0, 2), Source::kOwn);
  for (double angle = 0.0; angle < 95.0; angle += 0.25) {
    for (double scale = -2.2; scale < 2.2; scale += 0.05) {
      const double here = predicted.Probability(angle * kDegree, scale);
      ASSERT_NEAR(here, predicted.Probability((angle + 0.01) * kDegree, scale), 0.01);
      ASSERT_NEAR(here, predicted.Probability(angle * kDegree, scale + 0.001), 0.01);
    }
  }
}

TEST(Predicted, ManyTrialsOverruleTheDefault) {
  const PredictedSuccess predicted = PredictedSuccess::Fit(Samples(4000, 40.0, 1), Source::kOwn);
  EXPECT_EQ(predicted.source(), Source::kOwn);
  EXPECT_EQ(predicted.trials(), 4000);
  EXPECT_NEAR(predicted.HalfwayRotation(), 40.0 * kDegree, 1.5 * kDegree);
  EXPECT_GT(predicted.Probability(20.0 * kDegree), 0.95);
  EXPECT_LT(predicted.Probability(58.0 * kDegree), 0.06);
  ExpectNonIncreasingAndBounded(predicted);
}

TEST(Predicted, FewTrialsAreNeverSure) {
  const double before = PredictedSuccess().Probability(22.5 * kDegree);
  const double after = PredictedSuccess::Fit({{22.5 * kDegree, 0.0, false}}, Source::kOwn).Probability(22.5 * kDegree);
  EXPECT_LT(after, before);
  EXPECT_GT(after, 0.5 * before);
}

TEST(Predicted, SixtyTrialsMoveTheWholeCurve) {
  // Spread over rotations and scales there is less than one trial a cell.
  for (const double half_deg : {18.0, 40.0}) {
    double error_deg = 0.0;
    for (std::uint32_t seed = 0; seed < 20; ++seed) {
      const PredictedSuccess predicted = PredictedSuccess::Fit(Samples(60, half_deg, seed), Source::kOwn);
      error_deg += (predicted.HalfwayRotation() / kDegree - half_deg) / 20.0;
      ExpectNonIncreasingAndBounded(predicted);
    }
    EXPECT_NEAR(error_deg, 0.0, 2.5) << half_deg;
  }
}

TEST(Predicted, ScaleIsLearnedJointlyWithRotation) {
  std::vector<PredictionSample> samples;
  for (int i = 0; i < 600; ++i) samples.push_back({(i % 20) * kDegree, (i % 41) / 20.0 - 1.0, (i % 41) <= 20});  // Farther: found.
  const PredictedSuccess predicted = PredictedSuccess::Fit(samples, Source::kOwn);
  EXPECT_GT(predicted.Probability(10.0 * kDegree, -0.8), 0.85);
  EXPECT_LT(predicted.Probability(10.0 * kDegree, 0.9), 0.2);
}

TEST(Predicted, TrialsThatContradictAFallInRotationArePooled) {
  std::vector<PredictionSample> samples;
  for (int i = 0; i < 200; ++i) samples.push_back({(i % 60) * kDegree, 0.0, (i % 60) > 30});  // Only found from aslant.
  ExpectNonIncreasingAndBounded(PredictedSuccess::Fit(samples, Source::kOwn));
}

TEST(Predicted, TrialsBehindTheHorizonSayNothing) {
  const PredictedSuccess predicted = PredictedSuccess::Fit({{2.0, 0.0, false}}, Source::kOwn);
  EXPECT_EQ(predicted.trials(), 0);
  EXPECT_EQ(predicted.source(), Source::kDefault);
}

TEST(Predicted, CountsComeBackAndBadOnesAreRefused) {
  const PredictedSuccess fitted = PredictedSuccess::Fit(Samples(300, 25.0, 3), Source::kPooled, 2.0);
  const PredictedSuccess again =
      PredictedSuccess::FromCounts(fitted.trial_counts(), fitted.success_counts(), fitted.source(), fitted.prior_count());
  for (double angle : {1.0, 13.0, 27.0, 44.0}) {
    EXPECT_EQ(again.Probability(angle * kDegree, 0.3), fitted.Probability(angle * kDegree, 0.3));
  }
  EXPECT_THROW(PredictedSuccess::FromCounts({1.0}, {1.0}, Source::kOwn), std::invalid_argument);
  std::vector<double> trials(fitted.trial_counts().size(), 1.0), successes(trials.size(), 2.0);
  EXPECT_THROW(PredictedSuccess::FromCounts(trials, successes, Source::kOwn), std::invalid_argument);
}

}  // namespace
}  // namespace vantage::measures
