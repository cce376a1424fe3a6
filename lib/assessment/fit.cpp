#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "assessment/assessor.h"
#include "geometry/view_sphere.h"

namespace vantage::assessment {

measures::ObservedSuccess FitObserved(const std::vector<Trial>& trials, measures::ObservedFit fit) {
  std::vector<measures::ConfidenceSample> proposals;
  for (const Trial& trial : trials) {
    for (const Proposal& proposal : trial.together) proposals.push_back({proposal.confidence, proposal.correct});
  }
  return measures::ObservedSuccess::Fit(proposals, measures::Source::kOwn, measures::ObservedSuccess::kPriorCount, fit);
}

measures::Measures FitMeasures(const std::vector<Trial>& trials, const recognition::RecogniserParams& recogniser,
                               measures::ObservedFit observed_fit) {
  measures::Measures measures;
  measures.observed = FitObserved(trials, observed_fit);
  const auto is_detected = [&](const std::vector<Proposal>& proposed) {
    return !proposed.empty() && proposed.front().correct && measures.observed.Probability(proposed.front().confidence) >= 0.5;
  };
  std::vector<measures::PredictionSample> predictions;
  for (const Trial& trial : trials) {
    if (trial.object_shown) predictions.push_back({trial.rotation_rad, trial.log2_scale, is_detected(trial.alone)});
  }
  measures.predicted = measures::PredictedSuccess::Fit(predictions, measures::Source::kOwn);

  std::vector<measures::JointSample> joint;
  for (const Trial& trial : trials) {
    if (!trial.object_shown || trial.others.empty()) continue;
    joint.emplace_back();
    joint.back().detected = is_detected(trial.together);
    joint.back().predicted.Add(measures.predicted.Probability(trial.rotation_rad, trial.log2_scale));
    for (const Displacement& other : trial.others) {
      joint.back().predicted.Add(measures.predicted.Probability(other.rotation_rad, other.log2_scale));
    }
  }
  measures.predicted.set_common_cause(measures::FitCommonCause(joint));
  if (!trials.empty()) measures.fingerprint = recogniser.Fingerprint();
  return measures;
}

double MedianDistance(const std::vector<measures::Viewpoint>& viewpoints) {
  if (viewpoints.empty()) return 1.0;
  std::vector<double> distances_m;
  for (const measures::Viewpoint& viewpoint : viewpoints) distances_m.push_back(viewpoint.distance_m);
  const auto middle = distances_m.begin() + static_cast<std::ptrdiff_t>(distances_m.size() / 2);
  std::nth_element(distances_m.begin(), middle, distances_m.end());
  return *middle;
}

std::vector<measures::WeightedViewpoint> UniformViewpoints(double min_elevation_rad, double max_elevation_rad,
                                                           const std::vector<double>& distances_m, int directions) {
  if (!(min_elevation_rad < max_elevation_rad) || min_elevation_rad >= M_PI_2 || max_elevation_rad <= -M_PI_2) {
    throw std::invalid_argument("UniformViewpoints: expected min_elevation_rad < max_elevation_rad within the sphere");
  }
  if (directions < 1 || distances_m.empty()) throw std::invalid_argument("UniformViewpoints: expected directions and distances");
  // Even over the band itself: z is uniform on a sphere, and so is any slice of it.
  const double z_min = std::sin(std::max(min_elevation_rad, -M_PI_2)), z_max = std::sin(std::min(max_elevation_rad, M_PI_2));
  std::vector<measures::WeightedViewpoint> viewpoints;
  const double weight = 1.0 / (static_cast<double>(directions) * static_cast<double>(distances_m.size()));
  for (const Eigen::Vector3d& direction : geometry::EvenDirections(directions)) {
    const double z = z_min + (z_max - z_min) * 0.5 * (direction.z() + 1.0);
    const double radius = std::sqrt(1.0 - z * z), azimuth = geometry::Azimuth(direction);
    const Eigen::Vector3d in_band(radius * std::cos(azimuth), radius * std::sin(azimuth), z);
    for (double distance_m : distances_m) {
      if (!(distance_m > 0.0)) throw std::invalid_argument("UniformViewpoints: distances must be > 0");
      viewpoints.push_back({{in_band, distance_m}, weight});
    }
  }
  return viewpoints;
}

}  // namespace vantage::assessment
