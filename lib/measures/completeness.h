// Model completeness (13): the expected probability of detecting the object over all the views that may come.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "measures/predicted.h"

namespace vantage::measures {

// How the views' probabilities combine for one direction. The sum of (13) can pass 1; always max <= noisy_or <= clipped_sum.
enum class CompletenessRule { kMax, kNoisyOr, kClippedSum };
CompletenessRule CompletenessRuleFromString(
    const std::string& text);  // "max", "noisy_or", "clipped_sum"; throws std::invalid_argument.
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
