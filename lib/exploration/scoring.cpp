#include "exploration/scoring.h"

#include <algorithm>
#include <cmath>

#include "geometry/rigid.h"

namespace vantage::exploration {
namespace {

// By how much one more view of probability p raises the combined probability of the others.
double Rise(double combined, double p, measures::CompletenessRule rule) {
  switch (rule) {
    case measures::CompletenessRule::kNoisyOr:
      return (1.0 - combined) * p;
    case measures::CompletenessRule::kClippedSum:
      return std::min(1.0 - combined, p);
    case measures::CompletenessRule::kMax:
      break;
  }
  return std::max(0.0, p - combined);
}

}  // namespace

GainScorer::GainScorer(const Belief& belief, measures::CompletenessRule rule) : belief_(belief), rule_(rule) {
  completeness_ = measures::Completeness(belief.views, belief.reachable, belief.predicted, rule);
  double total = 0.0;
  for (const measures::WeightedViewpoint& query : belief.reachable) total += query.weight;
  for (const measures::WeightedViewpoint& query : belief.reachable) {
    if (query.weight == 0.0) continue;
    const double probability = measures::DetectionProbability(belief.views, query.viewpoint, belief.predicted, rule);
    if (probability < 1.0) queries_.push_back({query.viewpoint, query.weight / total, probability});
  }
}

double GainScorer::Gain(const measures::Viewpoint& view) const {
  const std::vector<measures::Viewpoint> alone{view};
  double gain = 0.0;
  for (const Query& query : queries_) {
    if (view.direction.dot(query.viewpoint.direction) <= 0.0) continue;  // From 90 degrees on the view shows nothing of it.
    gain +=
        query.weight * Rise(query.probability, measures::DetectionProbability(alone, query.viewpoint, belief_.predicted), rule_);
  }
  return gain;
}

void FailureMemory::Note(const Attempt& attempt) {
  if (attempt.view_added) {
    failures_.clear();
  } else {
    failures_.push_back(attempt.viewpoint);
  }
}

double FailureMemory::Factor(const measures::Viewpoint& view) const {
  const auto near = std::count_if(failures_.begin(), failures_.end(), [&](const measures::Viewpoint& failure) {
    return geometry::AngleBetween(failure.direction, view.direction) <= radius_rad_;
  });
  return std::pow(discount_, static_cast<double>(near));
}

}  // namespace vantage::exploration
