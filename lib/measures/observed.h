// Observed detection success p(o|c): how likely a detection of confidence c is right (equations 9, 10).
#pragma once

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

// Two Gaussians, p(c|o) and p(c|not o), and the posterior made monotone: a posterior that falls while c rises is wrong in the tails
// of the narrower Gaussian.
class ObservedSuccess {
 public:
  ObservedSuccess();  // The shipped default.
  // Throws std::invalid_argument where a sigma is not > 0 or a mean not finite.
  ObservedSuccess(const Gaussian& positive, const Gaussian& negative, Source source);

  // Fits both Gaussians. Each is drawn towards the default's as if `prior_count` samples of the default had been seen too, so that
  // few samples are never sure. With no samples: the default.
  static ObservedSuccess Fit(const std::vector<ConfidenceSample>& samples, Source source, double prior_count = 10.0);

  // p(o|c) with prior p(o) in (0, 1); non-decreasing in c. Equation (10); prior 1/2 is the paper's. Where the positive mean is not
  // above the negative one, c tells nothing and the prior comes back.
  double Probability(double confidence, double prior = 0.5) const;

  const Gaussian& positive() const { return positive_; }
  const Gaussian& negative() const { return negative_; }
  Source source() const { return source_; }

 private:
  Gaussian positive_;
  Gaussian negative_;
  Source source_ = Source::kDefault;
  double lowest_ = 0.0;  // Below and above these confidences the posterior is held constant.
  double highest_ = 1.0;
};

}  // namespace vantage::measures
