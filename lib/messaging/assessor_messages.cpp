#include "messaging/assessor_messages.h"

#include <cmath>
#include <stdexcept>

#include "messaging/geometry_messages.h"

namespace vantage::messaging {
namespace {

gaussian_t ToMessage(const measures::Gaussian& gaussian) {
  gaussian_t message;
  message.mean = gaussian.mean;
  message.sigma = gaussian.sigma;
  message.count = gaussian.count;
  return message;
}

Result<measures::Gaussian> FromMessage(const gaussian_t& message) {
  if (!std::isfinite(message.mean) || !std::isfinite(message.sigma) || message.sigma <= 0.0 || message.count < 0) {
    return Result<measures::Gaussian>::Error("a Gaussian that is out of range");
  }
  return measures::Gaussian{message.mean, message.sigma, message.count};
}

// Throws std::invalid_argument.
measures::ObservedSuccess Observed(const measures_t& message, const measures::Gaussian& positive,
                                   const measures::Gaussian& negative) {
  const measures::Source source = measures::SourceFromString(message.observed_source);
  const measures::ObservedFit fit = measures::ObservedFitFromString(message.observed_fit);
  if (fit == measures::ObservedFit::kGaussians) return {positive, negative, source};
  if (message.knot_confidence.size() != message.knot_log_ratio.size()) throw std::invalid_argument("knots that are not pairs");
  std::vector<measures::Knot> curve;
  for (std::size_t i = 0; i < message.knot_confidence.size(); ++i) {
    curve.push_back({message.knot_confidence[i], message.knot_log_ratio[i]});
  }
  return {positive, negative, source, fit, std::move(curve)};
}

bool IsCount(double value) { return std::isfinite(value) && value >= 0.0; }

}  // namespace

viewpoint_t ToMessage(const measures::Viewpoint& viewpoint) {
  viewpoint_t message;
  for (int i = 0; i < 3; ++i) message.direction[i] = viewpoint.direction[i];
  message.distance_m = viewpoint.distance_m;
  return message;
}

Result<measures::Viewpoint> FromMessage(const viewpoint_t& message) {
  const Eigen::Vector3d direction(message.direction[0], message.direction[1], message.direction[2]);
  if (!direction.allFinite() || std::abs(direction.norm() - 1.0) > 0.01) {
    return Result<measures::Viewpoint>::Error("a view direction that is not of unit length");
  }
  if (!(message.distance_m > 0.0 && message.distance_m <= 100.0)) {
    return Result<measures::Viewpoint>::Error("a view distance outside (0, 100] m");
  }
  return measures::Viewpoint{direction.normalized(), message.distance_m};
}

measures_t ToMessage(const ObjectMeasures& measures) {
  measures_t message;
  message.utime = measures.utime;
  message.object = measures.object;
  message.views = measures.views;
  message.fingerprint = measures.measures.fingerprint;
  message.observed_source = measures::ToString(measures.measures.observed.source());
  message.positive = ToMessage(measures.measures.observed.positive());
  message.negative = ToMessage(measures.measures.observed.negative());
  message.observed_fit = measures::ToString(measures.measures.observed.fit());
  for (const measures::Knot& knot : measures.measures.observed.curve()) {
    message.knot_confidence.push_back(knot.confidence);
    message.knot_log_ratio.push_back(knot.log_ratio);
  }
  message.knots = static_cast<std::int16_t>(message.knot_confidence.size());
  message.predicted_source = measures::ToString(measures.measures.predicted.source());
  message.trials = measures.measures.predicted.trial_counts();
  message.successes = measures.measures.predicted.success_counts();
  message.cells = static_cast<std::int16_t>(message.trials.size());
  message.prior_count = measures.measures.predicted.prior_count();
  message.common_cause = measures.measures.predicted.common_cause();
  message.completeness = measures.completeness;
  return message;
}

Result<ObjectMeasures> FromMessage(const measures_t& message) {
  using Measures = Result<ObjectMeasures>;
  const auto positive = FromMessage(message.positive);
  const auto negative = FromMessage(message.negative);
  if (!positive || !negative) return Measures::Error(positive ? negative.error : positive.error);
  if (message.object.empty()) return Measures::Error("measures of an object without a name");
  if (!IsCount(message.prior_count)) return Measures::Error("a prior count that is negative or not finite");
  if (!IsProbability(message.completeness)) return Measures::Error("a completeness outside [0, 1]");
  for (double value : message.trials) {
    if (!IsCount(value)) return Measures::Error("a trial count that is negative or not finite");
  }
  for (double value : message.successes) {
    if (!IsCount(value)) return Measures::Error("a success count that is negative or not finite");
  }
  ObjectMeasures result;
  result.utime = message.utime;
  result.object = message.object;
  result.views = message.views;
  result.completeness = message.completeness;
  result.measures.fingerprint = message.fingerprint;
  try {
    result.measures.observed = Observed(message, *positive, *negative);
    result.measures.predicted = measures::PredictedSuccess::FromCounts(
        message.trials, message.successes, measures::SourceFromString(message.predicted_source), message.prior_count);
    result.measures.predicted.set_common_cause(message.common_cause);
  } catch (const std::invalid_argument& error) {
    return Measures::Error(error.what());
  }
  return result;
}

completeness_t ToMessage(const ObjectCompleteness& completeness) {
  completeness_t message;
  message.utime = completeness.utime;
  message.object = completeness.object;
  message.rule = measures::ToString(completeness.rule);
  message.completeness = completeness.completeness;
  message.reach_known = completeness.reach_known;
  message.distance_m = completeness.distance_m;
  const int columns = completeness.sphere.azimuth_cells();
  message.azimuth_cells = static_cast<std::int16_t>(columns);
  message.elevation_cells = static_cast<std::int16_t>(completeness.sphere.elevation_cells());
  for (int row = 0; row < message.elevation_cells; ++row) {
    std::vector<float> values;
    for (int column = 0; column < columns; ++column) {
      values.push_back(static_cast<float>(completeness.cells.at(static_cast<std::size_t>(row * columns + column))));
    }
    message.cells.push_back(values);
  }
  for (const auto& view : completeness.views) message.viewpoints.push_back(ToMessage(view));
  message.views = static_cast<std::int16_t>(message.viewpoints.size());
  return message;
}

Result<ObjectCompleteness> FromMessage(const completeness_t& message) {
  using Completeness = Result<ObjectCompleteness>;
  if (!IsProbability(message.completeness)) return Completeness::Error("a completeness outside [0, 1]");
  if (!(message.distance_m > 0.0 && message.distance_m <= 100.0)) return Completeness::Error("a distance outside (0, 100] m");
  if (message.azimuth_cells < 1 || message.elevation_cells < 1) return Completeness::Error("a view sphere without cells");
  ObjectCompleteness result;
  result.utime = message.utime;
  result.object = message.object;
  result.completeness = message.completeness;
  result.reach_known = message.reach_known != 0;
  result.distance_m = message.distance_m;
  result.sphere = geometry::ViewSphere(message.azimuth_cells, message.elevation_cells);
  for (const auto& row : message.cells) {
    for (float value : row) {
      if (!IsProbability(value)) return Completeness::Error("a cell outside [0, 1]");
      result.cells.push_back(value);
    }
  }
  try {
    result.rule = measures::CompletenessRuleFromString(message.rule);
  } catch (const std::invalid_argument& error) {
    return Completeness::Error(error.what());
  }
  for (const auto& entry : message.viewpoints) {
    const auto view = FromMessage(entry);
    if (!view) return Completeness::Error(view.error);
    result.views.push_back(*view);
  }
  return result;
}

reach_t ToMessage(const Reach& reach) {
  reach_t message;
  message.utime = reach.utime;
  message.object = reach.object;
  for (const auto& viewpoint : reach.viewpoints) {
    weighted_viewpoint_t entry;
    entry.viewpoint = ToMessage(viewpoint.viewpoint);
    entry.weight = viewpoint.weight;
    message.viewpoints.push_back(entry);
  }
  message.count = static_cast<std::int16_t>(message.viewpoints.size());
  return message;
}

Result<Reach> FromMessage(const reach_t& message) {
  Reach reach;
  reach.utime = message.utime;
  reach.object = message.object;
  for (const auto& entry : message.viewpoints) {
    const auto viewpoint = FromMessage(entry.viewpoint);
    if (!viewpoint) return Result<Reach>::Error(viewpoint.error);
    if (!std::isfinite(entry.weight) || entry.weight < 0.0) return Result<Reach>::Error("a weight that is negative or not finite");
    reach.viewpoints.push_back({*viewpoint, entry.weight});
  }
  return reach;
}

}  // namespace vantage::messaging
