// Shared by the exploration tests: a hand-made prediction curve and a mount that is easy to reason about.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>

#include "exploration/planner.h"

namespace vantage::exploration {

inline constexpr double kDegree = M_PI / 180.0;

// Detection falls from 1 to 0 between `sure_deg` and `hopeless_deg` off the learned direction, whatever the scale; all views fail
// of the same causes.
inline measures::PredictedSuccess Falling(double sure_deg = 10.0, double hopeless_deg = 45.0) {
  using measures::PredictedSuccess;
  std::vector<double> trials(PredictedSuccess::kRotationCells * PredictedSuccess::kScaleCells, 1e6), successes(trials);
  for (std::size_t i = 0; i < trials.size(); ++i) {
    const double degrees = 5.0 * (static_cast<double>(i / PredictedSuccess::kScaleCells) + 0.5);
    successes[i] *= std::clamp((hopeless_deg - degrees) / (hopeless_deg - sure_deg), 0.0, 1.0);
  }
  auto predicted = PredictedSuccess::FromCounts(trials, successes, measures::Source::kOwn);
  predicted.set_common_cause(1.0);
  return predicted;
}

inline Eigen::Vector3d Direction(double azimuth_deg, double elevation_deg = 0.0) {
  return {std::cos(azimuth_deg * kDegree) * std::cos(elevation_deg * kDegree),
          std::sin(azimuth_deg * kDegree) * std::cos(elevation_deg * kDegree), std::sin(elevation_deg * kDegree)};
}

// The object stands at the world's origin with the world's axes.
inline CandidateView ViewFrom(int id, double azimuth_deg, double elevation_deg = 0.0, double distance_m = 0.6) {
  CandidateView view;
  view.id = id;
  view.viewpoint = {Direction(azimuth_deg, elevation_deg), distance_m};
  view.T_world_camera = geometry::LookAt(distance_m * view.viewpoint.direction, Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ());
  return view;
}

// Candidates on a ring around the object, `step_deg` apart; id = position in the ring.
inline std::vector<CandidateView> Ring(double step_deg) {
  std::vector<CandidateView> views;
  for (int i = 0; i * step_deg < 360.0 - 1e-9; ++i) views.push_back(ViewFrom(i, i * step_deg));
  return views;
}

inline std::vector<measures::WeightedViewpoint> AllOf(const std::vector<CandidateView>& views) {
  std::vector<measures::WeightedViewpoint> all;
  for (const CandidateView& view : views) all.push_back({view.viewpoint, 1.0});
  return all;
}

inline Belief BeliefFrom(const std::vector<CandidateView>& learned, const std::vector<CandidateView>& reachable) {
  Belief belief;
  for (const CandidateView& view : learned) belief.views.push_back(view.viewpoint);
  belief.predicted = Falling();
  belief.reachable = AllOf(reachable);
  return belief;
}

// Flies straight through everything, but refuses what it is told to, with and without planning.
class TestMount : public motion::Mount {
 public:
  using Refusal = std::function<std::string(const geometry::Rigid& T_world_camera)>;
  Refusal unreachable = [](const geometry::Rigid&) { return ""; };
  Refusal no_path = [](const geometry::Rigid&) { return ""; };
  motion::SpeedLimits limits;
  mutable std::vector<std::size_t> goals_planned;  // Per call of Plan.

  std::string WhyUnreachable(const geometry::Rigid& T_world_camera) const override { return unreachable(T_world_camera); }

  std::vector<motion::PathResult> Plan(const motion::Stance& start, const std::vector<geometry::Rigid>& T_world_camera_goals,
                                       std::uint32_t) const override {
    goals_planned.push_back(T_world_camera_goals.size());
    std::vector<motion::PathResult> results;
    for (const geometry::Rigid& goal : T_world_camera_goals) {
      motion::PathResult result;
      result.refusal = unreachable(goal);
      if (result.refusal.empty()) result.refusal = no_path(goal);
      if (result.refusal.empty()) result.trajectory = motion::TimePath({start.T_world_camera, goal}, limits);
      results.push_back(result);
    }
    return results;
  }
};

}  // namespace vantage::exploration
