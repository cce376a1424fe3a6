#include "measures/text.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace vantage::measures {
namespace {

Measures Fitted() {
  Measures measures;
  measures.observed = ObservedSuccess::Fit({{0.31, true}, {0.62, true}, {0.11, false}, {1.0 / 3.0, false}}, Source::kOwn);
  measures.predicted = PredictedSuccess::Fit({{0.1, 0.3, true}, {0.4, -0.7, false}, {0.9, 0.0, false}}, Source::kPooled, 3.0);
  measures.predicted.set_common_cause(1.0 / 7.0);
  measures.fingerprint = "sift \"2000\" é";
  return measures;
}

TEST(MeasuresText, ComesBackToTheLastBit) {
  const Measures before = Fitted();
  const Measures after = MeasuresFromText(ToText(before));
  EXPECT_EQ(after.fingerprint, before.fingerprint);
  EXPECT_EQ(after.observed.source(), Source::kOwn);
  EXPECT_EQ(after.predicted.source(), Source::kPooled);
  EXPECT_EQ(after.observed.positive().count, 2);
  EXPECT_EQ(after.predicted.trials(), 3);
  EXPECT_EQ(after.predicted.common_cause(), before.predicted.common_cause());
  for (double x = 0.0; x <= 1.0; x += 0.01) {
    EXPECT_EQ(after.observed.Probability(x), before.observed.Probability(x));
    EXPECT_EQ(after.predicted.Probability(x, x - 0.5), before.predicted.Probability(x, x - 0.5));
  }
  EXPECT_EQ(ToText(after), ToText(before));
}

TEST(MeasuresText, EveryFitComesBack) {
  for (const ObservedFit fit : {ObservedFit::kLogistic, ObservedFit::kIsotonic}) {
    Measures before = Fitted();
    before.observed = ObservedSuccess::Fit({{0.31, true}, {0.62, true}, {0.11, false}, {0.2, true}}, Source::kOwn, 10.0, fit);
    const Measures after = MeasuresFromText(ToText(before));
    EXPECT_EQ(after.observed.fit(), fit);
    for (double x = 0.0; x <= 1.0; x += 0.01) EXPECT_EQ(after.observed.Probability(x), before.observed.Probability(x));
  }
}

TEST(MeasuresText, BrokenTextSaysSo) {
  const std::string text = ToText(Fitted());
  EXPECT_THROW(MeasuresFromText(""), std::runtime_error);
  EXPECT_THROW(MeasuresFromText("{}"), std::runtime_error);
  EXPECT_THROW(MeasuresFromText("[1, 2]"), std::runtime_error);
  EXPECT_THROW(MeasuresFromText(text.substr(0, text.size() / 2)), std::runtime_error);
  std::string bad_source = text;
  bad_source.replace(bad_source.find("pooled"), 6, "stolen");
  EXPECT_THROW(MeasuresFromText(bad_source), std::runtime_error);
}

}  // namespace
}  // namespace vantage::measures
