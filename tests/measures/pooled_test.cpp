#include "measures/pooled.h"

#include <gtest/gtest.h>

namespace vantage::measures {
namespace {

Measures Own(double positive_mean, bool detected, int trials, const std::string& fingerprint) {
  Measures measures;
  measures.observed = ObservedSuccess({positive_mean, 0.1, trials}, {0.1, 0.05, trials}, Source::kOwn);
  measures.predicted =
      PredictedSuccess::Fit(std::vector<PredictionSample>(static_cast<std::size_t>(trials), {0.3, 0.0, detected}), Source::kOwn);
  measures.fingerprint = fingerprint;
  return measures;
}

TEST(Pooled, ObjectsCountTheSameAndDifferencesBetweenThemWiden) {
  const Measures pooled = Pooled({Own(0.3, true, 100, "a"), Own(0.5, false, 300, "a")}, "a");
  EXPECT_EQ(pooled.observed.source(), Source::kPooled);
  EXPECT_EQ(pooled.predicted.source(), Source::kPooled);
  EXPECT_NEAR(pooled.observed.positive().mean, 0.4, 1e-12);
  EXPECT_NEAR(pooled.observed.positive().sigma, std::sqrt(0.1 * 0.1 + 0.1 * 0.1), 1e-12);
  EXPECT_NEAR(pooled.observed.negative().sigma, 0.05, 1e-12);
  EXPECT_EQ(pooled.observed.positive().count, 200);
  EXPECT_EQ(pooled.predicted.trials(), 200);
  EXPECT_NEAR(pooled.predicted.Probability(0.3), 0.25, 0.05);  // 100 of 400.
  EXPECT_EQ(pooled.fingerprint, "a");
}

TEST(Pooled, OtherSettingsAndWhatIsNotOnesOwnDoNotCount) {
  Measures borrowed = Own(0.9, true, 50, "a");
  borrowed.observed = ObservedSuccess(borrowed.observed.positive(), borrowed.observed.negative(), Source::kPooled);
  borrowed.predicted = PredictedSuccess();
  const Measures pooled = Pooled({Own(0.9, true, 100, "other"), borrowed, Measures()}, "a");
  EXPECT_EQ(pooled.observed.source(), Source::kDefault);
  EXPECT_EQ(pooled.predicted.source(), Source::kDefault);
  EXPECT_EQ(pooled.observed.Probability(0.2), ObservedSuccess().Probability(0.2));
  EXPECT_TRUE(pooled.fingerprint.empty());
}

}  // namespace
}  // namespace vantage::measures
