#include "measures/observed.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace vantage::measures {
namespace {

// A textured box in 360 pairs of photographs, 0 to 75 degrees from the one view known, with the recogniser's default settings:
// right ones had 0.29 +- 0.09, wrong ones 0.12 +- 0.07. Other objects differ, so the right ones are lower and wider here.
constexpr Gaussian kDefaultPositive{0.27, 0.12, 0};
constexpr Gaussian kDefaultNegative{0.12, 0.07, 0};

// Confidences are ratios of a few dozen points: no population of them is narrower than this.
constexpr double kMinSigma = 0.01;

Gaussian Sanitised(Gaussian gaussian) {
  if (!std::isfinite(gaussian.mean)) throw std::invalid_argument("ObservedSuccess: the mean must be finite");
  if (!(gaussian.sigma > 0.0) || !std::isfinite(gaussian.sigma)) throw std::invalid_argument("ObservedSuccess: sigma must be > 0");
  gaussian.sigma = std::max(gaussian.sigma, kMinSigma);
  return gaussian;
}

double LogDensity(const Gaussian& gaussian, double x) {
  const double z = (x - gaussian.mean) / gaussian.sigma;
  return -0.5 * z * z - std::log(gaussian.sigma);
}

// Mean and variance of the samples and `prior_count` draws of the prior together.
Gaussian FitTowards(const std::vector<double>& values, const Gaussian& prior, double prior_count) {
  if (values.empty() && prior_count <= 0.0) return prior;
  const double n = static_cast<double>(values.size()) + prior_count;
  double mean = prior_count * prior.mean;
  for (double value : values) mean += value;
  mean /= n;
  double variance = prior_count * (prior.sigma * prior.sigma + (prior.mean - mean) * (prior.mean - mean));
  for (double value : values) variance += (value - mean) * (value - mean);
  return {mean, std::max(kMinSigma, std::sqrt(variance / n)), static_cast<int>(values.size())};
}

}  // namespace

std::string ToString(Source source) {
  switch (source) {
    case Source::kOwn:
      return "own";
    case Source::kPooled:
      return "pooled";
    case Source::kDefault:
      break;
  }
  return "default";
}

Source SourceFromString(const std::string& text) {
  for (Source source : {Source::kOwn, Source::kPooled, Source::kDefault}) {
    if (ToString(source) == text) return source;
  }
  throw std::invalid_argument("a measure's source must be own, pooled or default, is \"" + text + "\"");
}

ObservedSuccess::ObservedSuccess() : ObservedSuccess(kDefaultPositive, kDefaultNegative, Source::kDefault) {}

ObservedSuccess::ObservedSuccess(const Gaussian& positive, const Gaussian& negative, Source source)
    : positive_(Sanitised(positive)), negative_(Sanitised(negative)), source_(source) {
  // log p(c|o) - log p(c|not o) is the parabola a c^2 + b c + const: it turns where 2 a c + b = 0.
  const double wp = 1.0 / (positive_.sigma * positive_.sigma);
  const double wn = 1.0 / (negative_.sigma * negative_.sigma);
  const double a = 0.5 * (wn - wp);
  const double b = positive_.mean * wp - negative_.mean * wn;
  if (std::abs(a) < 1e-9) return;  // Equal widths: a line, rising where the means are in order.
  const double turn = std::clamp(-b / (2.0 * a), 0.0, 1.0);
  (a > 0.0 ? lowest_ : highest_) = turn;
}

ObservedSuccess ObservedSuccess::Fit(const std::vector<ConfidenceSample>& samples, Source source, double prior_count) {
  if (!(prior_count >= 0.0)) throw std::invalid_argument("ObservedSuccess: prior_count must be >= 0");
  if (samples.empty()) return {};
  std::vector<double> right, wrong;
  for (const ConfidenceSample& sample : samples) (sample.correct ? right : wrong).push_back(sample.confidence);
  return {FitTowards(right, kDefaultPositive, prior_count), FitTowards(wrong, kDefaultNegative, prior_count), source};
}

double ObservedSuccess::Probability(double confidence, double prior) const {
  if (!(prior > 0.0 && prior < 1.0)) throw std::invalid_argument("ObservedSuccess: the prior must be in (0, 1)");
  // Means the wrong way round: this confidence does not tell right from wrong, and the prior is all that is known.
  if (positive_.mean <= negative_.mean) return prior;
  const double c = std::clamp(std::isnan(confidence) ? 0.0 : confidence, lowest_, highest_);
  // Equation (10) with both branches, as log odds so that nothing underflows.
  const double log_odds = LogDensity(positive_, c) - LogDensity(negative_, c) + std::log(prior / (1.0 - prior));
  return 1.0 / (1.0 + std::exp(-log_odds));
}

}  // namespace vantage::measures
