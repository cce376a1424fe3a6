#include "measures/completeness.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "geometry/rigid.h"

namespace vantage::measures {

CompletenessRule CompletenessRuleFromString(const std::string& text) {
  for (CompletenessRule rule : {CompletenessRule::kMax, CompletenessRule::kNoisyOr, CompletenessRule::kClippedSum}) {
    if (ToString(rule) == text) return rule;
  }
  throw std::invalid_argument("the completeness rule must be max, noisy_or or clipped_sum, is \"" + text + "\"");
}

std::string ToString(CompletenessRule rule) {
  switch (rule) {
    case CompletenessRule::kNoisyOr:
      return "noisy_or";
    case CompletenessRule::kClippedSum:
      return "clipped_sum";
    case CompletenessRule::kMax:
      break;
  }
  return "max";
}

double DetectionProbability(const std::vector<Viewpoint>& views, const Viewpoint& query, const PredictedSuccess& predicted,
                            CompletenessRule rule) {
  double largest = 0.0, all_fail = 1.0, sum = 0.0;
  for (const Viewpoint& view : views) {
    if (!(view.distance_m > 0.0) || !(query.distance_m > 0.0)) {
      throw std::invalid_argument("DetectionProbability: a viewpoint's distance_m must be > 0");
    }
    const double rotation_rad = geometry::AngleBetween(view.direction, query.direction);
    if (rotation_rad >= M_PI_2) continue;
    const double p = predicted.Probability(rotation_rad, std::log2(view.distance_m / query.distance_m));
    largest = std::max(largest, p);
    all_fail *= 1.0 - p;
    sum += p;
  }
  switch (rule) {
    case CompletenessRule::kNoisyOr:
      return 1.0 - all_fail;
    case CompletenessRule::kClippedSum:
      return std::min(1.0, sum);
    case CompletenessRule::kMax:
      break;
  }
  return largest;
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
