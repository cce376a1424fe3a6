#include "measures/observed.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace vantage::measures {
namespace {

void ExpectMonotoneAndFinite(const ObservedSuccess& observed, double prior = 0.5) {
  double last = 0.0;
  for (int i = 0; i <= 1000; ++i) {
    const double p = observed.Probability(i / 1000.0, prior);
    ASSERT_TRUE(std::isfinite(p) && p >= 0.0 && p <= 1.0) << "c = " << i / 1000.0;
    ASSERT_GE(p, last - 1e-12) << "c = " << i / 1000.0;
    last = p;
  }
}

TEST(Observed, IsEquationTenWhereTheGaussiansAreInOrder) {
  const ObservedSuccess observed({0.5, 0.15, 100}, {0.15, 0.08, 100}, Source::kOwn);
  const auto density = [](double c, double mean, double sigma) {
    return std::exp(-0.5 * std::pow((c - mean) / sigma, 2)) / (std::sqrt(2 * M_PI) * sigma);
  };
  for (double c : {0.12, 0.2, 0.3, 0.4, 0.6}) {
    const double right = density(c, 0.5, 0.15), wrong = density(c, 0.15, 0.08);
    EXPECT_NEAR(observed.Probability(c), right / (right + wrong), 1e-9);
    EXPECT_NEAR(observed.Probability(c, 0.1), 0.1 * right / (0.1 * right + 0.9 * wrong), 1e-9);
  }
}

TEST(Observed, NeverFallsWhileConfidenceRises) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> mean(-0.1, 1.1), log_sigma(std::log(1e-4), std::log(2.0)), prior(0.01, 0.99);
  for (int i = 0; i < 300; ++i) {
    const Gaussian positive{mean(random), std::exp(log_sigma(random)), 5}, negative{mean(random), std::exp(log_sigma(random)), 5};
    SCOPED_TRACE(testing::Message() << positive.mean << " " << positive.sigma << " / " << negative.mean << " " << negative.sigma);
    ExpectMonotoneAndFinite({positive, negative, Source::kOwn}, prior(random));
  }
  ExpectMonotoneAndFinite(ObservedSuccess({0.4, 0.1, 5}, {0.4, 0.1, 5}, Source::kOwn));
  ExpectMonotoneAndFinite(ObservedSuccess({0.2, 0.1, 5}, {0.6, 0.1, 5}, Source::kOwn));
}

TEST(Observed, TheWiderNegativeDoesNotWinBeyondThePositive) {
  // Unrepaired, the ratio at c = 1 would favour "wrong" by a wide margin.
  const ObservedSuccess observed({0.5, 0.05, 50}, {0.2, 0.2, 50}, Source::kOwn);
  EXPECT_GT(observed.Probability(1.0), 0.9);
  EXPECT_LT(observed.Probability(0.3), 0.1);
}

TEST(Observed, TheDefaultKnowsRightFromWrongAndSaysItIsTheDefault) {
  const ObservedSuccess observed;
  EXPECT_EQ(observed.source(), Source::kDefault);
  EXPECT_LT(observed.Probability(0.08), 0.2);  // The paper: under 0.1 tends to be false,
  EXPECT_GT(observed.Probability(0.4), 0.95);  // and 0.4 is almost certain.
  EXPECT_GT(observed.Probability(0.2, 0.9), observed.Probability(0.2, 0.5));
  EXPECT_THROW(observed.Probability(0.5, 1.0), std::invalid_argument);
  ExpectMonotoneAndFinite(observed);
}

TEST(Observed, FitFindsTheGaussiansOfManySamplesAndStaysNearTheDefaultForFew) {
  std::mt19937 random(7);
  std::normal_distribution<double> right(0.6, 0.1), wrong(0.2, 0.05);
  std::vector<ConfidenceSample> samples;
  for (int i = 0; i < 4000; ++i) samples.push_back({i % 2 ? right(random) : wrong(random), i % 2 == 1});
  const ObservedSuccess many = ObservedSuccess::Fit(samples, Source::kOwn);
  EXPECT_NEAR(many.positive().mean, 0.6, 0.01);
  EXPECT_NEAR(many.positive().sigma, 0.1, 0.01);
  EXPECT_NEAR(many.negative().mean, 0.2, 0.01);
  EXPECT_NEAR(many.negative().sigma, 0.05, 0.01);
  EXPECT_EQ(many.positive().count, 2000);
  EXPECT_EQ(many.source(), Source::kOwn);

  const ObservedSuccess one = ObservedSuccess::Fit({{0.9, true}}, Source::kOwn);
  EXPECT_NEAR(one.positive().mean, ObservedSuccess().positive().mean, 0.06);
  EXPECT_NEAR(one.negative().mean, ObservedSuccess().negative().mean, 1e-12);

  const ObservedSuccess none = ObservedSuccess::Fit({}, Source::kOwn);
  EXPECT_EQ(none.source(), Source::kDefault);
  EXPECT_EQ(none.Probability(0.3), ObservedSuccess().Probability(0.3));
}

TEST(Observed, IdenticalSamplesAreNoReasonForCertainty) {
  ExpectMonotoneAndFinite(ObservedSuccess::Fit(std::vector<ConfidenceSample>(500, {0.5, true}), Source::kOwn, 0.0));
}

TEST(Observed, BadGaussiansAreRefused) {
  EXPECT_THROW(ObservedSuccess({0.5, 0.0, 1}, {0.1, 0.1, 1}, Source::kOwn), std::invalid_argument);
  EXPECT_THROW(ObservedSuccess({0.5, 0.1, 1}, {std::nan(""), 0.1, 1}, Source::kOwn), std::invalid_argument);
}

// Confidences whose true log ratio is 40 (c - 0.3).
std::vector<ConfidenceSample> LogisticSamples(int count) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::vector<ConfidenceSample> samples;
  for (int i = 0; i < count; ++i) {
    const double c = 0.6 * uniform(random);
    samples.push_back({c, uniform(random) < 1.0 / (1.0 + std::exp(-40.0 * (c - 0.3)))});
  }
  return samples;
}

TEST(Observed, EveryFitFindsTheCurveOfManySamples) {
  const std::vector<ConfidenceSample> samples = LogisticSamples(6000);
  for (const ObservedFit fit : {ObservedFit::kLogistic, ObservedFit::kIsotonic}) {
    SCOPED_TRACE(ToString(fit));
    const ObservedSuccess observed = ObservedSuccess::Fit(samples, Source::kOwn, 10.0, fit);
    EXPECT_EQ(observed.fit(), fit);
    ExpectMonotoneAndFinite(observed);
    for (const double c : {0.2, 0.25, 0.3, 0.35, 0.4}) {
      EXPECT_NEAR(observed.Probability(c), 1.0 / (1.0 + std::exp(-40.0 * (c - 0.3))), 0.06) << c;
    }
    EXPECT_GT(observed.Probability(0.3, 0.9), 0.8);
  }
}

TEST(Observed, EveryFitIsUnsureOfFewSamples) {
  for (const ObservedFit fit : {ObservedFit::kGaussians, ObservedFit::kLogistic, ObservedFit::kIsotonic}) {
    SCOPED_TRACE(ToString(fit));
    const ObservedSuccess observed = ObservedSuccess::Fit({{0.5, true}, {0.45, false}}, Source::kOwn, 10.0, fit);
    ExpectMonotoneAndFinite(observed);
    EXPECT_NEAR(observed.Probability(0.19), 0.5, 0.35);
    EXPECT_LT(observed.Probability(0.05), 0.4);
    ExpectMonotoneAndFinite(ObservedSuccess::Fit(std::vector<ConfidenceSample>(500, {0.5, true}), Source::kOwn, 0.0, fit));
    ExpectMonotoneAndFinite(ObservedSuccess::Fit({{0.5, true}, {0.5, false}, {0.5, true}}, Source::kOwn, 0.0, fit));
  }
}

TEST(Observed, CurvesThatFallAreRefused) {
  const Gaussian positive{0.5, 0.1, 1}, negative{0.1, 0.1, 1};
  const auto make = [&](const std::vector<Knot>& curve) {
    return ObservedSuccess(positive, negative, Source::kOwn, ObservedFit::kIsotonic, curve);
  };
  EXPECT_NO_THROW(make({{0.1, -1.0}, {0.2, -1.0}, {0.3, 2.0}}));
  EXPECT_THROW(make({}), std::invalid_argument);
  EXPECT_THROW(make({{0.1, 1.0}, {0.2, 0.0}}), std::invalid_argument);
  EXPECT_THROW(make({{0.2, 0.0}, {0.2, 1.0}}), std::invalid_argument);
  EXPECT_THROW(make({{0.2, std::nan("")}}), std::invalid_argument);
}

TEST(Source, TextComesBack) {
  for (Source source : {Source::kOwn, Source::kPooled, Source::kDefault}) EXPECT_EQ(SourceFromString(ToString(source)), source);
  EXPECT_THROW(SourceFromString("mine"), std::invalid_argument);
}

}  // namespace
}  // namespace vantage::measures
