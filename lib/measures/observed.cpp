#include "measures/observed.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
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

// A sample, or part of what stands for the default.
struct Weighted {
  double confidence = 0.0;
  double right = 0.0;  // Weights, of which one is 0.
  double wrong = 0.0;
};

// Standard normal quantiles at 5, 15, .. 95 %: samples that stand for a Gaussian.
constexpr std::array kQuantiles = {-1.645, -1.036, -0.674, -0.385, -0.126, 0.126, 0.385, 0.674, 1.036, 1.645};

// Both sides with a total weight of their mean count, the default's share included, by rising confidence. Empty where a side is.
std::vector<Weighted> Balanced(const std::vector<double>& right, const std::vector<double>& wrong, double prior_count) {
  const double rights = static_cast<double>(right.size()) + prior_count, wrongs = static_cast<double>(wrong.size()) + prior_count;
  if (rights <= 0.0 || wrongs <= 0.0) return {};
  const double right_weight = 0.5 * (rights + wrongs) / rights, wrong_weight = 0.5 * (rights + wrongs) / wrongs;
  std::vector<Weighted> samples;
  for (const double confidence : right) samples.push_back({confidence, right_weight, 0.0});
  for (const double confidence : wrong) samples.push_back({confidence, 0.0, wrong_weight});
  const double share = prior_count / static_cast<double>(kQuantiles.size());
  for (const double z : kQuantiles) {
    if (prior_count <= 0.0) break;
    samples.push_back({std::max(0.0, kDefaultPositive.mean + z * kDefaultPositive.sigma), share * right_weight, 0.0});
    samples.push_back({std::max(0.0, kDefaultNegative.mean + z * kDefaultNegative.sigma), 0.0, share * wrong_weight});
  }
  std::stable_sort(samples.begin(), samples.end(),
                   [](const Weighted& a, const Weighted& b) { return a.confidence < b.confidence; });
  return samples;
}

// Log odds a + b c of greatest likelihood, b >= 0, by Newton's method. A little is added to the curvature: samples that are told
// apart without a mistake would have no finite answer.
std::vector<Knot> Logistic(const std::vector<Weighted>& samples) {
  constexpr double kRidge = 1e-3;
  Eigen::Vector2d x = Eigen::Vector2d::Zero();
  for (int iteration = 0; iteration < 50; ++iteration) {
    Eigen::Vector2d gradient = -kRidge * x;
    Eigen::Matrix2d curvature = kRidge * Eigen::Matrix2d::Identity();
    for (const Weighted& sample : samples) {
      const Eigen::Vector2d basis(1.0, sample.confidence);
      const double p = 1.0 / (1.0 + std::exp(-x.dot(basis))), weight = sample.right + sample.wrong;
      gradient += (sample.right - weight * p) * basis;
      curvature += weight * p * (1.0 - p) * basis * basis.transpose();
    }
    const Eigen::Vector2d step = curvature.ldlt().solve(gradient);
    x += step * std::min(1.0, 10.0 / std::max(1e-12, step.norm()));
    if (step.norm() < 1e-9) break;
  }
  if (x[1] <= 0.0) return {{0.0, 0.0}};  // Confidence tells nothing.
  return {{0.0, x[0]}, {1.0, x[0] + x[1]}};
}

// Blocks of a non-decreasing share of right samples; as sure as one more sample of the other kind allows.
std::vector<Knot> Isotonic(const std::vector<Weighted>& samples) {
  struct Block {
    double confidence = 0.0, right = 0.0, wrong = 0.0;  // Sum of weighted confidences, weights.
    double weight() const { return right + wrong; }
    double share() const { return right / weight(); }
  };
  std::vector<Block> blocks;
  for (const Weighted& sample : samples) {
    blocks.push_back({sample.confidence * (sample.right + sample.wrong), sample.right, sample.wrong});
    while (blocks.size() > 1 && blocks[blocks.size() - 2].share() >= blocks.back().share()) {
      const Block last = blocks.back();
      blocks.pop_back();
      blocks.back().confidence += last.confidence;
      blocks.back().right += last.right;
      blocks.back().wrong += last.wrong;
    }
  }
  std::vector<Knot> curve;
  for (const Block& block : blocks) {
    const Knot knot{block.confidence / block.weight(), std::log((block.right + 0.5) / (block.wrong + 0.5))};
    if (!curve.empty() && !(knot.confidence > curve.back().confidence)) continue;
    curve.push_back(knot);
    // The half sample draws small blocks to the middle; the curve still must not fall.
    if (curve.size() > 1) curve.back().log_ratio = std::max(knot.log_ratio, curve[curve.size() - 2].log_ratio);
  }
  return curve;
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

std::string ToString(ObservedFit fit) {
  switch (fit) {
    case ObservedFit::kLogistic:
      return "logistic";
    case ObservedFit::kIsotonic:
      return "isotonic";
    case ObservedFit::kGaussians:
      break;
  }
  return "gaussians";
}

ObservedFit ObservedFitFromString(const std::string& text) {
  for (const ObservedFit fit : kObservedFits) {
    if (ToString(fit) == text) return fit;
  }
  throw std::invalid_argument("p(o|c) must be fitted by gaussians, logistic or isotonic, is \"" + text + "\"");
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

ObservedSuccess::ObservedSuccess(const Gaussian& positive, const Gaussian& negative, Source source, ObservedFit fit,
                                 std::vector<Knot> curve)
    : positive_(Sanitised(positive)), negative_(Sanitised(negative)), source_(source), fit_(fit), curve_(std::move(curve)) {
  if (fit == ObservedFit::kGaussians || curve_.empty()) throw std::invalid_argument("ObservedSuccess: a curve needs knots");
  for (std::size_t i = 0; i < curve_.size(); ++i) {
    if (!std::isfinite(curve_[i].confidence) || !std::isfinite(curve_[i].log_ratio)) {
      throw std::invalid_argument("ObservedSuccess: a knot is not finite");
    }
    if (i > 0 && !(curve_[i].confidence > curve_[i - 1].confidence && curve_[i].log_ratio >= curve_[i - 1].log_ratio)) {
      throw std::invalid_argument("ObservedSuccess: the curve must rise");
    }
  }
}

ObservedSuccess ObservedSuccess::Fit(const std::vector<ConfidenceSample>& samples, Source source, double prior_count,
                                     ObservedFit fit) {
  if (!(prior_count >= 0.0)) throw std::invalid_argument("ObservedSuccess: prior_count must be >= 0");
  if (samples.empty()) return {};
  std::vector<double> right, wrong;
  for (const ConfidenceSample& sample : samples) (sample.correct ? right : wrong).push_back(sample.confidence);
  const Gaussian positive = FitTowards(right, kDefaultPositive, prior_count);
  const Gaussian negative = FitTowards(wrong, kDefaultNegative, prior_count);
  if (fit == ObservedFit::kGaussians) return {positive, negative, source};
  const std::vector<Weighted> weighted = Balanced(right, wrong, prior_count);
  // One side is empty, and nothing is known of it.
  if (weighted.empty()) return {positive, negative, source};
  return {positive, negative, source, fit, fit == ObservedFit::kLogistic ? Logistic(weighted) : Isotonic(weighted)};
}

double ObservedSuccess::LogRatio(double confidence) const {
  if (curve_.empty()) return LogDensity(positive_, confidence) - LogDensity(negative_, confidence);
  const auto next = std::lower_bound(curve_.begin(), curve_.end(), confidence,
                                     [](const Knot& knot, double value) { return knot.confidence < value; });
  if (next == curve_.begin()) return curve_.front().log_ratio;
  if (next == curve_.end()) return curve_.back().log_ratio;
  const Knot& before = *std::prev(next);
  const double share = (confidence - before.confidence) / (next->confidence - before.confidence);
  return before.log_ratio + share * (next->log_ratio - before.log_ratio);
}

double ObservedSuccess::Probability(double confidence, double prior) const {
  if (!(prior > 0.0 && prior < 1.0)) throw std::invalid_argument("ObservedSuccess: the prior must be in (0, 1)");
  // Means the wrong way round: this confidence does not tell right from wrong, and the prior is all that is known.
  if (positive_.mean <= negative_.mean) return prior;
  const double c = std::clamp(std::isnan(confidence) ? 0.0 : confidence, lowest_, highest_);
  // Equation (10) with both branches, as log odds so that nothing underflows.
  return 1.0 / (1.0 + std::exp(-LogRatio(c) - std::log(prior / (1.0 - prior))));
}

}  // namespace vantage::measures
