#include "measures/completeness.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "geometry/view_sphere.h"

namespace vantage::measures {
namespace {

std::vector<WeightedViewpoint> WholeSphere(double distance_m = 1.0) {
  std::vector<WeightedViewpoint> queries;
  for (const Eigen::Vector3d& direction : geometry::EvenDirections(500)) queries.push_back({{direction, distance_m}, 1.0});
  return queries;
}

std::vector<Viewpoint> RandomViews(int count, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<Viewpoint> views;
  for (int i = 0; i < count; ++i) {
    views.push_back({Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized(), 1.0});
  }
  return views;
}

TEST(Completeness, TheRulesAreOrderedAndProbabilities) {
  const PredictedSuccess predicted;
  const auto queries = WholeSphere();
  for (int count : {1, 5, 30, 200}) {
    const auto views = RandomViews(count, static_cast<std::uint32_t>(count));
    double last = 0.0;
    for (const CompletenessRule rule : kCompletenessRules) {  // In this order.
      const double now = Completeness(views, queries, predicted, rule);
      EXPECT_GT(now, 0.0);
      EXPECT_GE(now, last - 1e-12) << ToString(rule);
      EXPECT_LE(now, 1.0);
      last = now;
    }
  }
}

TEST(Completeness, NoViewsOrNoQueriesIsZero) {
  EXPECT_EQ(Completeness({}, WholeSphere(), PredictedSuccess()), 0.0);
  EXPECT_EQ(Completeness(RandomViews(3, 1), {}, PredictedSuccess()), 0.0);
  EXPECT_EQ(Completeness(RandomViews(3, 1), {{{}, 0.0}}, PredictedSuccess()), 0.0);
}

TEST(Completeness, AViewNeverMakesTheModelLessComplete) {
  const PredictedSuccess predicted;
  const auto queries = WholeSphere();
  const auto all = RandomViews(25, 9);
  for (const CompletenessRule rule : kCompletenessRules) {
    std::vector<Viewpoint> views;
    double last = 0.0;
    for (const Viewpoint& view : all) {
      views.push_back(view);
      const double now = Completeness(views, queries, predicted, rule);
      EXPECT_GE(now, last);
      last = now;
    }
  }
}

TEST(Completeness, WeightsDecideAndNeedNoNormalisation) {
  const Viewpoint front{Eigen::Vector3d::UnitX(), 0.7}, back{-Eigen::Vector3d::UnitX(), 0.7};
  const PredictedSuccess predicted;
  const double seen = predicted.Probability(0.0);
  EXPECT_NEAR(Completeness({front}, {{front, 1.0}, {back, 0.0}}, predicted), seen, 1e-12);
  EXPECT_NEAR(Completeness({front}, {{front, 30.0}, {back, 10.0}}, predicted), 0.75 * seen, 1e-12);
  EXPECT_THROW(Completeness({front}, {{front, -1.0}}, predicted), std::invalid_argument);
}

TEST(Completeness, DistanceCountsAsScale) {
  const PredictedSuccess predicted;
  const Viewpoint learned{Eigen::Vector3d::UnitZ(), 0.5};
  const double at_learned = DetectionProbability({learned}, learned, predicted);
  const double twice_as_far = DetectionProbability({learned}, {Eigen::Vector3d::UnitZ(), 1.0}, predicted);
  EXPECT_NEAR(twice_as_far, predicted.Probability(0.0, -1.0), 1e-12);
  EXPECT_LT(twice_as_far, at_learned);
  EXPECT_EQ(DetectionProbability({learned}, {Eigen::Vector3d::UnitZ(), 5.0}, predicted), 0.0);
  EXPECT_THROW(DetectionProbability({learned}, {Eigen::Vector3d::UnitZ(), 0.0}, predicted), std::invalid_argument);
}

TEST(CommonCause, IsFoundInWhatViewsDidTogether) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> uniform;
  for (const double share : {0.1, 0.5, 0.9}) {
    std::vector<JointSample> samples;
    for (int i = 0; i < 30000; ++i) {
      const double p = uniform(random), q = uniform(random);
      const bool together = uniform(random) < share;  // One cause for both, or one for each.
      const double cause = uniform(random);
      samples.emplace_back();
      samples.back().predicted.Add(p);
      samples.back().predicted.Add(q);
      samples.back().detected = together ? cause < std::max(p, q) : cause < p || uniform(random) < q;
    }
    EXPECT_NEAR(FitCommonCause(samples), share, 0.08);
  }
  EXPECT_NEAR(FitCommonCause({}), PredictedSuccess::kDefaultCommonCause, 1e-9);
}

TEST(CommonCause, MakesTheRuleBetweenMaxAndNoisyOr) {
  const auto views = RandomViews(12, 5);
  const auto queries = WholeSphere();
  PredictedSuccess predicted;
  const auto by = [&](CompletenessRule rule) { return Completeness(views, queries, predicted, rule); };
  predicted.set_common_cause(1.0);
  EXPECT_NEAR(by(CompletenessRule::kCommonCause), by(CompletenessRule::kMax), 1e-12);
  predicted.set_common_cause(0.0);
  EXPECT_NEAR(by(CompletenessRule::kCommonCause), by(CompletenessRule::kNoisyOr), 1e-12);
  predicted.set_common_cause(0.25);
  EXPECT_NEAR(by(CompletenessRule::kCommonCause), 0.25 * by(CompletenessRule::kMax) + 0.75 * by(CompletenessRule::kNoisyOr), 1e-12);
  EXPECT_THROW(predicted.set_common_cause(1.5), std::invalid_argument);
}

TEST(CompletenessRule, TextComesBack) {
  for (const CompletenessRule rule : kCompletenessRules) {
    EXPECT_EQ(CompletenessRuleFromString(ToString(rule)), rule);
  }
  EXPECT_THROW(CompletenessRuleFromString("sum"), std::invalid_argument);
}

}  // namespace
}  // namespace vantage::measures
