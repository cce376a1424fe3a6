#include "exploration/shared_strategy.h"

#include <cmath>
#include <stdexcept>

namespace vantage::exploration {

SharedStrategy::SharedStrategy(const PlannerParams& params, std::uint32_t seed)
    : params_(params),
      seed_(seed),
      failures_(params.failure_radius_rad, params.failure_discount),
      odds_(params.attempt_log_odds),
      t_plan_s_(params.t_plan_s),
      t_learn_s_(params.t_learn_s) {}

Decision SharedStrategy::Decide(const Belief& belief, const std::vector<CandidateView>& candidates, const motion::Stance& stance,
                                const motion::Mount& mount, double elapsed_s) {
  const GainScorer scorer(belief, params_.rule, well_known_);
  Decision decision;
  decision.completeness = scorer.completeness();
  decision.stop = StopWhateverThereIs(decision.completeness, elapsed_s);
  if (decision.stop != StopReason::kNone) return decision;
  for (const CandidateView& view : candidates) {
    Candidate candidate;
    candidate.view = view;
    candidate.t_plan_s = t_plan_s_.mean();
    candidate.t_learn_s = t_learn_s_.mean();
    decision.candidates.push_back(candidate);
  }
  Score(belief, scorer, decision.candidates);
  Choose(belief, decision, stance, mount);
  last_chosen_id_.reset();
  if (decision.chosen < 0) return decision;
  Candidate& chosen = decision.candidates[static_cast<std::size_t>(decision.chosen)];
  last_chosen_id_ = chosen.view.id;
  last_predicted_ = measures::DetectionProbability(belief.views, chosen.view.viewpoint, belief.predicted, params_.rule);
  chosen.path = mount.Shortened(*chosen.path, DecisionSeed());
  SetCosts(chosen);
  return decision;
}

void SharedStrategy::Score(const Belief& belief, const GainScorer& scorer, std::vector<Candidate>& candidates) const {
  for (Candidate& candidate : candidates) {
    const measures::Viewpoint& view = candidate.view.viewpoint;
    const double predicted = measures::DetectionProbability(belief.views, view, belief.predicted, params_.rule);
    candidate.detect_probability = failures_.Factor(view) * odds_.Probability(predicted);
    candidate.gain = scorer.Gain(view);
  }
}

void SharedStrategy::Report(const Attempt& attempt) {
  if (!(attempt.t_plan_s >= 0.0) || !(attempt.t_learn_s >= 0.0) || !std::isfinite(attempt.t_plan_s + attempt.t_learn_s)) {
    throw std::invalid_argument("an attempt's t_plan_s and t_learn_s must be >= 0 and finite");
  }
  attempted_.push_back(attempt.viewpoint);
  if (attempt.well_known && !attempt.view_added) well_known_.push_back(attempt.viewpoint);
  failures_.Note(attempt);
  t_plan_s_.Add(attempt.t_plan_s);
  if (attempt.looked) t_learn_s_.Add(attempt.t_learn_s);
  if (!last_chosen_id_) return;
  tried_ids_.insert(*last_chosen_id_);
  if (attempt.looked) odds_.Note(last_predicted_, attempt.detected);
}

void SharedStrategy::PlanPaths(const std::vector<Candidate*>& candidates, const motion::Stance& stance,
                               const motion::Mount& mount) const {
  std::vector<geometry::Rigid> goals;
  for (const Candidate* candidate : candidates) goals.push_back(candidate->view.T_world_camera);
  std::vector<motion::PathResult> paths = mount.Plan(stance, goals, DecisionSeed());
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    Candidate& candidate = *candidates[i];
    candidate.refusal = paths[i].refusal;
    candidate.path = std::move(paths[i].trajectory);
    if (candidate.path) SetCosts(candidate);
  }
}

void SharedStrategy::SetCosts(Candidate& candidate) const {
  candidate.t_move_s = candidate.path->duration_s();
  candidate.utility_s = ExpectedWorth(candidate) - (candidate.t_plan_s + candidate.t_move_s + candidate.t_learn_s);
}

std::vector<Candidate*> SharedStrategy::Untried(Decision& decision, const motion::Mount& mount) const {
  std::vector<Candidate*> untried;
  for (Candidate& candidate : decision.candidates) {
    const bool was_tried = tried_ids_.count(candidate.view.id) > 0;
    candidate.refusal = was_tried ? "already tried" : mount.WhyUnreachable(candidate.view.T_world_camera);
    if (candidate.refusal.empty()) untried.push_back(&candidate);
  }
  return untried;
}

void SharedStrategy::GoToFirst(const std::vector<Candidate*>& queue, Decision& decision, const motion::Stance& stance,
                               const motion::Mount& mount) const {
  for (Candidate* candidate : queue) {
    PlanPaths({candidate}, stance, mount);
    if (!candidate->path) continue;
    decision.chosen = static_cast<int>(candidate - decision.candidates.data());
    return;
  }
  decision.stop = StopReason::kNothingReachable;
}

StopReason SharedStrategy::StopWhateverThereIs(double completeness, double elapsed_s) const {
  if (completeness >= params_.target_completeness) return StopReason::kTargetReached;
  if (elapsed_s >= params_.time_budget_s) return StopReason::kTimeBudget;
  if (static_cast<int>(attempted_.size()) >= params_.max_attempts) return StopReason::kMaxAttempts;
  return StopReason::kNone;
}

}  // namespace vantage::exploration
