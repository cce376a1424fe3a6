#include "exploration/scoring.h"

#include <algorithm>
#include <cmath>

#include "geometry/rigid.h"

namespace vantage::exploration {
GainScorer::GainScorer(const Belief& belief, measures::CompletenessRule rule) : belief_(belief), rule_(rule) {
  completeness_ = measures::Completeness(belief.views, belief.reachable, belief.predicted, rule);
  double total = 0.0;
  for (const measures::WeightedViewpoint& query : belief.reachable) total += query.weight;
  for (const measures::WeightedViewpoint& query : belief.reachable) {
    if (query.weight == 0.0) continue;
    const auto so_far = measures::Joint(belief.views, query.viewpoint, belief.predicted);
    if (ValueOf(so_far) < 1.0) queries_.push_back({query.viewpoint, query.weight / total, so_far});
  }
}

double GainScorer::Gain(const measures::Viewpoint& view) const {
  const std::vector<measures::Viewpoint> alone{view};
  double gain = 0.0;
  for (const Query& query : queries_) {
    if (view.direction.dot(query.viewpoint.direction) <= 0.0) continue;  // From 90 degrees on the view shows nothing of it.
    measures::JointProbability with_view = query.so_far;
    with_view.Add(measures::DetectionProbability(alone, query.viewpoint, belief_.predicted));
    gain += query.weight * (ValueOf(with_view) - ValueOf(query.so_far));
  }
  return gain;
}

double GainScorer::ValueOf(const measures::JointProbability& joint) const {
  return joint.Value(rule_, belief_.predicted.common_cause());
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
