// Observed detection success p(o|c): how likely a detection of confidence c is right (equations 9, 10).
#pragma once

#include <array>
#include <string>
#include <vector>

namespace vantage::measures {

// Whose trials a measure was fitted on.
enum class Source { kOwn, kPooled, kDefault };
std::string ToString(Source source);               // "own", "pooled", "default".
Source SourceFromString(const std::string& text);  // Throws std::invalid_argument.

// One labelled hypothesis.
struct ConfidenceSample {
  double confidence = 0.0;  // c of equation (2), [0, 1].
  bool correct = false;
};

struct Gaussian {
  double mean = 0.0;
  double sigma = 1.0;  // > 0.
  int count = 0;       // Samples it was fitted on.
};

// How p(o|c) is made of labelled confidences.
enum class ObservedFit {
  kGaussians,  // p(c|o) and p(c|not o) as two Gaussians: the paper's.
  kLogistic,   // Log odds linear in c (Platt, 1999).
  kIsotonic    // Any rising curve (pooling adjacent violators).
};
inline constexpr std::array kObservedFits = {ObservedFit::kGaussians, ObservedFit::kLogistic, ObservedFit::kIsotonic};
std::string ToString(ObservedFit fit);                       // "gaussians", "logistic", "isotonic".
ObservedFit ObservedFitFromString(const std::string& text);  // Throws std::invalid_argument.

// log p(c|o) - log p(c|not o) at a confidence; straight between knots, constant beyond the outermost.
struct Knot {
  double confidence = 0.0;
  double log_ratio = 0.0;
};

// log p(c|o) - log p(c|not o), by two Gaussians or a curve, made monotone: a posterior that falls while c rises is wrong in the
// tails of the narrower Gaussian. The Gaussians are known whatever the fit.
class ObservedSuccess {
 public:
  static constexpr double kPriorCount = 10.0;

  ObservedSuccess();  // The shipped default.
  // Throws std::invalid_argument where a sigma is not > 0 or a mean not finite.
  ObservedSuccess(const Gaussian& positive, const Gaussian& negative, Source source);
  // By a curve instead. Throws std::invalid_argument as well where there are no knots, a value is not finite, confidences do not
  // rise or ratios fall.
  ObservedSuccess(const Gaussian& positive, const Gaussian& negative, Source source, ObservedFit fit, std::vector<Knot> curve);

  // Right and wrong samples weigh the same in all, as the prior is not theirs. Each side is drawn towards the default's Gaussian as
  // if `prior_count` samples of it had been seen too, so that few samples are never sure. With no samples: the default. Cost: one
  // sort.
  static ObservedSuccess Fit(const std::vector<ConfidenceSample>& samples, Source source, double prior_count = kPriorCount,
                             ObservedFit fit = ObservedFit::kGaussians);

  // p(o|c) with prior p(o) in (0, 1); non-decreasing in c. Equation (10); prior 1/2 is the paper's. Where the positive mean is not
  // above the negative one, c tells nothing and the prior comes back.
  double Probability(double confidence, double prior = 0.5) const;

  const Gaussian& positive() const { return positive_; }
  const Gaussian& negative() const { return negative_; }
  Source source() const { return source_; }
  ObservedFit fit() const { return fit_; }
  const std::vector<Knot>& curve() const { return curve_; }  // Empty for Gaussians.

 private:
  double LogRatio(double confidence) const;

  Gaussian positive_;
  Gaussian negative_;
  Source source_ = Source::kDefault;
  ObservedFit fit_ = ObservedFit::kGaussians;
  std::vector<Knot> curve_;
  double lowest_ = 0.0;  // Below and above these confidences the posterior is held constant.
  double highest_ = 1.0;
};

}  // namespace vantage::measures
