#include "measures/calibration.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>

namespace vantage::measures {
namespace {

TEST(Calibration, BrierScoreOfKnownForecasts) {
  EXPECT_EQ(BrierScore({}), 0.0);
  EXPECT_NEAR(BrierScore({{1.0, true}, {0.0, false}}), 0.0, 1e-12);
  EXPECT_NEAR(BrierScore({{0.5, true}, {0.5, false}}), 0.25, 1e-12);
  EXPECT_NEAR(BrierScore({{0.8, true}, {0.8, false}}), (0.04 + 0.64) / 2, 1e-12);
}

TEST(Calibration, HonestForecastsHaveNoErrorAndOverconfidentOnesDo) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::vector<Forecast> honest, overconfident;
  for (int i = 0; i < 20000; ++i) {
    const double p = uniform(random);
    const bool outcome = uniform(random) < p;
    honest.push_back({p, outcome});
    overconfident.push_back({p < 0.5 ? 0.2 * p : 1.0 - 0.2 * (1.0 - p), outcome});
  }
  EXPECT_LT(CalibrationError(honest), 0.02);
  EXPECT_GT(CalibrationError(overconfident), 0.15);
  EXPECT_LT(BrierScore(honest), BrierScore(overconfident));
}

TEST(Calibration, BinsHoldEqualMassAndNeverPartEqualProbabilities) {
  std::vector<Forecast> forecasts;
  for (int i = 0; i < 100; ++i) forecasts.push_back({std::pow(i / 100.0, 3), i % 3 == 0});
  for (const ReliabilityBin& bin : Reliability(forecasts, 10)) EXPECT_EQ(bin.count, 10);

  // Ten of one kind: one bin, whatever the order they come in.
  std::vector<Forecast> ties(10, {0.7, false});
  for (int i = 0; i < 7; ++i) ties[i].outcome = true;
  const auto table = Reliability(ties, 5);
  ASSERT_EQ(table.size(), 1u);
  EXPECT_EQ(table[0].count, 10);
  EXPECT_NEAR(table[0].frequency, 0.7, 1e-12);
  EXPECT_NEAR(CalibrationError(ties, 5), 0.0, 1e-12);
}

TEST(Calibration, EveryForecastIsInOneBin) {
  for (int n : {1, 3, 9, 10, 11, 57}) {
    std::vector<Forecast> forecasts;
    for (int i = 0; i < n; ++i) forecasts.push_back({(i * 7 % n) / double(n), i % 2 == 0});
    int total = 0;
    for (const ReliabilityBin& bin : Reliability(forecasts, 10)) total += bin.count;
    EXPECT_EQ(total, n);
  }
  EXPECT_TRUE(Reliability({}).empty());
  EXPECT_THROW(Reliability({{0.5, true}}, 0), std::invalid_argument);
}

TEST(Calibration, ErrorOfThreeForecastsByHand) {
  // Three bins of one: (|0.1 - 0| + |0.6 - 1| + |0.9 - 0|) / 3. One bin: |1.6 / 3 - 1 / 3|.
  const std::vector<Forecast> forecasts = {{0.6, true}, {0.9, false}, {0.1, false}};
  EXPECT_NEAR(CalibrationError(forecasts, 3), 1.4 / 3.0, 1e-12);
  EXPECT_NEAR(CalibrationError(forecasts, 15), 1.4 / 3.0, 1e-12);  // More bins than forecasts: the empty ones are left out.
  EXPECT_NEAR(CalibrationError(forecasts, 1), 0.2, 1e-12);
}

TEST(Bootstrap, DrawsWholeGroups) {
  // Two frames, all wrong and all right: a resample is one of them twice or both, so the Brier score is 1, 0 or 1/2.
  const std::vector<std::vector<Forecast>> groups = {{{1.0, false}, {1.0, false}}, {{1.0, true}, {1.0, true}}};
  const Interval interval = BootstrapInterval(groups, BrierScore, 400, 0.95, 1);
  EXPECT_EQ(interval.lower, 0.0);
  EXPECT_EQ(interval.upper, 1.0);
  const Interval middle = BootstrapInterval(groups, BrierScore, 400, 0.3, 1);
  EXPECT_EQ(middle.lower, 0.5);
  EXPECT_EQ(middle.upper, 0.5);
}

TEST(Bootstrap, IsAsWideAsTheSamplingErrorAndTheSameAgain) {
  std::mt19937 random(8);
  std::vector<std::vector<Forecast>> groups;
  for (int i = 0; i < 400; ++i) groups.push_back({{0.0, random() % 4 == 0}});
  const Interval interval = BootstrapInterval(groups, BrierScore, 1000, 0.95, 5);
  // The mean of 400 draws that are true a quarter of the time: standard error 0.0217, 95 % within +-0.042.
  EXPECT_NEAR(interval.upper - interval.lower, 0.085, 0.012);
  EXPECT_LT(interval.lower, 0.25);
  EXPECT_GT(interval.upper, 0.25);
  EXPECT_EQ(BootstrapInterval(groups, BrierScore, 1000, 0.95, 5).lower, interval.lower);
}

TEST(Bootstrap, OfATableDrawsItsRowsAndItsColumns) {
  // Rows that differ and columns that do not, and the other way round: either alone makes the mean uncertain by as much.
  const std::vector<std::vector<double>> rows = {{0.0, 0.0}, {1.0, 1.0}}, columns = {{0.0, 1.0}, {0.0, 1.0}};
  for (const auto& table : {rows, columns}) {
    const Interval interval = BootstrapMeanInterval(table, 400, 0.95, 1);
    EXPECT_EQ(interval.lower, 0.0);
    EXPECT_EQ(interval.upper, 1.0);
    const Interval middle = BootstrapMeanInterval(table, 400, 0.3, 1);
    EXPECT_EQ(middle.lower, 0.5);
    EXPECT_EQ(middle.upper, 0.5);
  }
}

TEST(Bootstrap, OfATableKnowsThatColumnsErrTogether) {
  // 10 models on the same 100 frames: where a frame errs for all, ten models are worth no more than one.
  std::mt19937 random(3);
  std::vector<std::vector<double>> together(10, std::vector<double>(100)), apart = together;
  for (std::size_t frame = 0; frame < 100; ++frame) {
    const double error = random() % 4 == 0;
    for (std::size_t model = 0; model < 10; ++model) {
      together[model][frame] = error;
      apart[model][frame] = random() % 4 == 0;
    }
  }
  const auto width = [](const Interval& interval) { return interval.upper - interval.lower; };
  EXPECT_NEAR(width(BootstrapMeanInterval(together)), 3.92 * 0.0433, 0.03);
  EXPECT_LT(width(BootstrapMeanInterval(apart)), 0.7 * width(BootstrapMeanInterval(together)));
}

TEST(Bootstrap, RefusesWhatMakesNoSense) {
  EXPECT_EQ(BootstrapMeanInterval({}).upper, 0.0);
  EXPECT_THROW(BootstrapMeanInterval({{1.0, 2.0}, {1.0}}), std::invalid_argument);
  EXPECT_THROW(BootstrapMeanInterval({}, 0), std::invalid_argument);
  EXPECT_EQ(BootstrapInterval({}, BrierScore).upper, 0.0);
  EXPECT_THROW(BootstrapInterval({}, BrierScore, 0), std::invalid_argument);
  EXPECT_THROW(BootstrapInterval({}, BrierScore, 10, 1.0), std::invalid_argument);
}

}  // namespace
}  // namespace vantage::measures
