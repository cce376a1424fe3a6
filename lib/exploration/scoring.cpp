#include "exploration/scoring.h"

#include <algorithm>
#include <cmath>

#include "geometry/rigid.h"

namespace vantage::exploration {
namespace {

constexpr double kShiftSigma = 1.0;  // Prior of AttemptOdds.
constexpr double kSurest = 1e-3;     // Single attempts at what is taken for sure or hopeless say no more than this.

double LogOdds(double p) { return std::log(p / (1.0 - p)); }
double Logistic(double log_odds) { return 1.0 / (1.0 + std::exp(-log_odds)); }

}  // namespace

GainScorer::GainScorer(const Belief& belief, measures::CompletenessRule rule, const std::vector<measures::Viewpoint>& well_known)
    : belief_(belief), rule_(rule) {
  std::vector<measures::Viewpoint> views = belief.views;
  views.insert(views.end(), well_known.begin(), well_known.end());
  completeness_ = measures::Completeness(belief.views, belief.reachable, belief.predicted, rule);
  double total = 0.0;
  for (const measures::WeightedViewpoint& query : belief.reachable) total += query.weight;
  for (const measures::WeightedViewpoint& query : belief.reachable) {
    if (query.weight == 0.0) continue;
    const auto so_far = measures::Joint(views, query.viewpoint, belief.predicted);
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

void AttemptOdds::Note(double predicted, bool detected) {
  outcomes_.push_back({LogOdds(std::clamp(predicted, kSurest, 1.0 - kSurest)), detected});
  for (int iteration = 0; iteration < 20; ++iteration) {  // Newton's method; the posterior has one maximum.
    double gradient = (first_guess_ - shift_) / (kShiftSigma * kShiftSigma), curvature = 1.0 / (kShiftSigma * kShiftSigma);
    for (const Outcome& outcome : outcomes_) {
      const double p = Logistic(outcome.log_odds + shift_);
      gradient += (outcome.detected ? 1.0 : 0.0) - p;
      curvature += p * (1.0 - p);
    }
    shift_ += std::clamp(gradient / curvature, -1.0, 1.0);
  }
}

double AttemptOdds::Probability(double predicted) const {
  if (predicted <= 0.0 || predicted >= 1.0) return predicted;
  return Logistic(LogOdds(predicted) + shift_);
}

void FailureMemory::Note(const Attempt& attempt) {
  if (!attempt.view_added && !attempt.well_known) failures_.push_back(attempt.viewpoint);
  if (!attempt.view_added) return;
  const auto outdated = [&](const measures::Viewpoint& failure) {
    return geometry::AngleBetween(failure.direction, attempt.viewpoint.direction) < kMatters_rad;
  };
  failures_.erase(std::remove_if(failures_.begin(), failures_.end(), outdated), failures_.end());
}

double FailureMemory::Factor(const measures::Viewpoint& view) const {
  const auto near = std::count_if(failures_.begin(), failures_.end(), [&](const measures::Viewpoint& failure) {
    return geometry::AngleBetween(failure.direction, view.direction) <= radius_rad_;
  });
  return std::pow(discount_, static_cast<double>(near));
}

}  // namespace vantage::exploration
