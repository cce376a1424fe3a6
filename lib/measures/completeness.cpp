#include "measures/completeness.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "geometry/rigid.h"

namespace vantage::measures {

CompletenessRule CompletenessRuleFromString(const std::string& text) {
  std::string names;
  for (const CompletenessRule rule : kCompletenessRules) {
    if (ToString(rule) == text) return rule;
    names += (names.empty() ? "" : ", ") + ToString(rule);
  }
  throw std::invalid_argument("the completeness rule must be one of " + names + ", is \"" + text + "\"");
}

std::string ToString(CompletenessRule rule) {
  switch (rule) {
    case CompletenessRule::kCommonCause:
      return "common_cause";
    case CompletenessRule::kNoisyOr:
      return "noisy_or";
    case CompletenessRule::kClippedSum:
      return "clipped_sum";
    case CompletenessRule::kMax:
      break;
  }
  return "max";
}

double JointProbability::Value(CompletenessRule rule, double common_cause) const {
  switch (rule) {
    case CompletenessRule::kCommonCause:
      return common_cause * largest_ + (1.0 - common_cause) * (1.0 - all_fail_);
    case CompletenessRule::kNoisyOr:
      return 1.0 - all_fail_;
    case CompletenessRule::kClippedSum:
      return std::min(1.0, sum_);
    case CompletenessRule::kMax:
      break;
  }
  return largest_;
}

JointProbability Joint(const std::vector<Viewpoint>& views, const Viewpoint& query, const PredictedSuccess& predicted) {
  JointProbability joint;
  for (const Viewpoint& view : views) {
    if (!(view.distance_m > 0.0) || !(query.distance_m > 0.0)) {
      throw std::invalid_argument("DetectionProbability: a viewpoint's distance_m must be > 0");
    }
    const double rotation_rad = geometry::AngleBetween(view.direction, query.direction);
    if (rotation_rad < M_PI_2) joint.Add(predicted.Probability(rotation_rad, std::log2(view.distance_m / query.distance_m)));
  }
  return joint;
}

double FitCommonCause(const std::vector<JointSample>& samples) {
  constexpr int kSteps = 400;
  constexpr double kSurest = 0.002;  // Single outcomes never rule a share out.
  std::array<double, kSteps + 1> log_posterior{};
  for (int i = 0; i <= kSteps; ++i) {
    const double share = static_cast<double>(i) / kSteps;
    const double prior = std::pow(share, 6) * std::pow(1.0 - share, 2);  // Beta(7, 3), not normalised.
    double& sum = log_posterior[static_cast<std::size_t>(i)] = std::log(std::max(prior, 1e-12));
    for (const JointSample& sample : samples) {
      const double p = std::clamp(sample.predicted.Value(CompletenessRule::kCommonCause, share), kSurest, 1.0 - kSurest);
      sum += std::log(sample.detected ? p : 1.0 - p);
    }
  }
  const double most = *std::max_element(log_posterior.begin(), log_posterior.end());
  double mean = 0.0, mass = 0.0;
  for (int i = 0; i <= kSteps; ++i) {
    const double weight = std::exp(log_posterior[static_cast<std::size_t>(i)] - most);
    mean += weight * i / kSteps;
    mass += weight;
  }
  return mean / mass;
}

double DetectionProbability(const std::vector<Viewpoint>& views, const Viewpoint& query, const PredictedSuccess& predicted,
                            CompletenessRule rule) {
  return Joint(views, query, predicted).Value(rule, predicted.common_cause());
}

double Completeness(const std::vector<Viewpoint>& views, const std::vector<WeightedViewpoint>& queries,
                    const PredictedSuccess& predicted, CompletenessRule rule) {
  double weighted = 0.0, total = 0.0;
  for (const WeightedViewpoint& query : queries) {
    if (!(query.weight >= 0.0)) throw std::invalid_argument("Completeness: a viewpoint's weight must be >= 0");
    if (query.weight == 0.0) continue;
    weighted += query.weight * DetectionProbability(views, query.viewpoint, predicted, rule);
    total += query.weight;
  }
  return total > 0.0 ? std::min(1.0, weighted / total) : 0.0;
}

}  // namespace vantage::measures
