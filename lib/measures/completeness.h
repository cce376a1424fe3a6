// Model completeness (13): the expected probability of detecting the object over all the views that may come.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "measures/predicted.h"

namespace vantage::measures {

// How the views' probabilities p_j combine for one direction. The sum of (13) can pass 1; always max <= common_cause <= noisy_or <=
// clipped_sum.
enum class CompletenessRule {
  kMax,          // "max": max p_j; all views fail of the same causes.
  kCommonCause,  // "common_cause": beta max p_j + (1 - beta) noisy_or, where beta = PredictedSuccess::common_cause() is the share
                 // of failures that come to all views at once (the beta-factor model of reliability).
  kNoisyOr,      // "noisy_or": 1 - prod(1 - p_j); every view fails for itself.
  kClippedSum    // "clipped_sum": min(1, sum p_j).
};
inline constexpr std::array kCompletenessRules = {CompletenessRule::kMax, CompletenessRule::kCommonCause,
                                                  CompletenessRule::kNoisyOr, CompletenessRule::kClippedSum};
CompletenessRule CompletenessRuleFromString(const std::string& text);  // Throws std::invalid_argument.
std::string ToString(CompletenessRule rule);

// From where a view was learned or may be seen: direction object -> camera (unit, object coordinates) and distance.
struct Viewpoint {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();
  double distance_m = 1.0;  // > 0.
};

// A viewpoint and p(theta), how often the object is seen from there.
struct WeightedViewpoint {
  Viewpoint viewpoint;
  double weight = 1.0;  // >= 0; need not be normalised.
};

// The views' probabilities of one direction, put together.
class JointProbability {
 public:
  void Add(double p) {
    largest_ = std::max(largest_, p);
    all_fail_ *= 1.0 - p;
    sum_ += p;
  }
  // `common_cause`: of kCommonCause only. 0 where nothing was added.
  double Value(CompletenessRule rule, double common_cause) const;

 private:
  double largest_ = 0.0, all_fail_ = 1.0, sum_ = 0.0;
};
JointProbability Joint(const std::vector<Viewpoint>& views, const Viewpoint& query, const PredictedSuccess& predicted);

// A look with several learned views on offer, and what came of it.
struct JointSample {
  JointProbability predicted;
  bool detected = false;
};

// The share of failures that come to all views at once, [0, 1]: its posterior mean. Before any look it is 0.7, with the weight of
// ten looks at failures (Beta(7, 3)): so it was where it could be measured (vantage evaluate completeness --frames even: 0.69).
// Cost: linear in samples.
double FitCommonCause(const std::vector<JointSample>& samples);

// p(o|theta) of one query viewpoint given the learned views. 0 without views. Cost: linear in views.
double DetectionProbability(const std::vector<Viewpoint>& views, const Viewpoint& query, const PredictedSuccess& predicted,
                            CompletenessRule rule = CompletenessRule::kMax);

// Equation (13): the weighted mean of DetectionProbability, in [0, 1]. 0 where the weights sum to 0.
double Completeness(const std::vector<Viewpoint>& views, const std::vector<WeightedViewpoint>& queries,
                    const PredictedSuccess& predicted, CompletenessRule rule = CompletenessRule::kMax);

// The set of both measures an object has, and what they were fitted for.
struct Measures {
  ObservedSuccess observed;
  PredictedSuccess predicted;
  std::string fingerprint;  // Of the features, t_int and recogniser settings the fit holds for; empty for the default.
};

}  // namespace vantage::measures
