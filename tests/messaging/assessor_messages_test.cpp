#include "messaging/assessor_messages.h"

#include <gtest/gtest.h>

#include <cmath>

#include "messaging/bus.h"

namespace vantage::messaging {
namespace {

ObjectMeasures SomeMeasures(measures::ObservedFit fit = measures::ObservedFit::kGaussians) {
  ObjectMeasures measures;
  measures.utime = 9;
  measures.object = "mug";
  measures.views = 3;
  measures.completeness = 0.4;
  measures.measures.fingerprint = "sift;4";
  measures.measures.observed =
      measures::ObservedSuccess::Fit({{0.7, true}, {0.8, true}, {0.1, false}, {0.2, false}}, measures::Source::kOwn, 10.0, fit);
  measures.measures.predicted =
      measures::PredictedSuccess::Fit({{0.1, 0.0, true}, {0.9, 0.3, false}, {0.4, -0.3, true}}, measures::Source::kOwn);
  measures.measures.predicted.set_common_cause(0.3);
  return measures;
}

TEST(AssessorMessages, MeasuresEvaluateTheSameAfterTheWire) {
  const auto measures = SomeMeasures();
  const auto message = ToMessage(measures);
  EXPECT_LT(message.getEncodedSize(), kMaxMessageBytes);
  const auto back = FromMessage(message);
  ASSERT_TRUE(back) << back.error;
  EXPECT_EQ(back->object, "mug");
  EXPECT_EQ(back->measures.fingerprint, "sift;4");
  EXPECT_EQ(back->measures.observed.source(), measures::Source::kOwn);
  EXPECT_EQ(back->measures.predicted.common_cause(), 0.3);
  for (double x = 0.0; x <= 1.0; x += 0.05) {
    EXPECT_DOUBLE_EQ(back->measures.observed.Probability(x), measures.measures.observed.Probability(x));
    EXPECT_DOUBLE_EQ(back->measures.predicted.Probability(x, x - 0.5), measures.measures.predicted.Probability(x, x - 0.5));
  }
}

TEST(AssessorMessages, EveryFitOfConfidencesSurvivesTheWire) {
  for (const auto fit : {measures::ObservedFit::kLogistic, measures::ObservedFit::kIsotonic}) {
    const auto measures = SomeMeasures(fit);
    auto message = ToMessage(measures);
    const auto back = FromMessage(message);
    ASSERT_TRUE(back) << back.error;
    EXPECT_EQ(back->measures.observed.fit(), fit);
    for (double x = 0.0; x <= 1.0; x += 0.05) {
      EXPECT_DOUBLE_EQ(back->measures.observed.Probability(x), measures.measures.observed.Probability(x));
    }
    message.knot_log_ratio.front() = 1000.0;  // Falls from there.
    EXPECT_FALSE(FromMessage(message));
    message.knot_log_ratio.pop_back();
    EXPECT_FALSE(FromMessage(message));
  }
}

TEST(AssessorMessages, MeasuresOutOfRangeAreRefused) {
  const auto good = ToMessage(SomeMeasures());
  auto bad = good;
  bad.positive.sigma = 0.0;
  EXPECT_FALSE(FromMessage(bad));
  bad = good;
  bad.predicted_source = "hearsay";
  EXPECT_FALSE(FromMessage(bad));
  bad = good;
  bad.common_cause = std::nan("");
  EXPECT_FALSE(FromMessage(bad));
  bad = good;
  bad.trials.pop_back();
  EXPECT_FALSE(FromMessage(bad));
  bad = good;
  bad.successes[0] = std::nan("");
  EXPECT_FALSE(FromMessage(bad));
  bad = good;
  bad.completeness = 1.5;
  EXPECT_FALSE(FromMessage(bad));
}

TEST(AssessorMessages, CompletenessSurvivesTheWire) {
  ObjectCompleteness completeness;
  completeness.object = "mug";
  completeness.completeness = 0.25;
  completeness.sphere = geometry::ViewSphere(12, 6);
  completeness.cells.assign(72, 0.5);
  completeness.cells[13] = 0.75;
  completeness.views.push_back({Eigen::Vector3d::UnitY(), 0.6});
  const auto message = ToMessage(completeness);
  const auto back = FromMessage(message);
  ASSERT_TRUE(back) << back.error;
  EXPECT_EQ(back->cells, completeness.cells);
  EXPECT_EQ(back->sphere.azimuth_cells(), 12);
  ASSERT_EQ(back->views.size(), 1u);
  EXPECT_DOUBLE_EQ(back->views[0].distance_m, 0.6);

  auto bad = message;
  bad.viewpoints[0].direction[1] = 0.0;
  EXPECT_FALSE(FromMessage(bad));
  bad = message;
  bad.cells[0][0] = 2.f;
  EXPECT_FALSE(FromMessage(bad));
  bad = message;
  bad.rule = "wishful";
  EXPECT_FALSE(FromMessage(bad));
}

TEST(AssessorMessages, ReachSurvivesTheWire) {
  Reach reach;
  reach.object = "mug";
  for (int i = 0; i < 400; ++i) reach.viewpoints.push_back({{Eigen::Vector3d::UnitZ(), 0.5}, 0.1 * i});
  const auto message = ToMessage(reach);
  EXPECT_LT(message.getEncodedSize(), kMaxMessageBytes);
  const auto back = FromMessage(message);
  ASSERT_TRUE(back) << back.error;
  ASSERT_EQ(back->viewpoints.size(), 400u);
  EXPECT_DOUBLE_EQ(back->viewpoints[10].weight, 1.0);
  auto bad = message;
  bad.viewpoints[0].weight = -1.0;
  EXPECT_FALSE(FromMessage(bad));
}

}  // namespace
}  // namespace vantage::messaging
