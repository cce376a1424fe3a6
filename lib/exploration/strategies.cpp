#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <stdexcept>

#include "exploration/planner.h"
#include "exploration/scoring.h"

namespace vantage::exploration {
namespace {

constexpr double kNoGain = 1e-9;

// What all strategies do the same way; they differ in Choose.
class SharedStrategy : public Strategy {
 public:
  SharedStrategy(const PlannerParams& params, std::uint32_t seed)
      : params_(params),
        seed_(seed),
        failures_(params.failure_radius_rad, params.failure_discount),
        t_plan_s_(params.t_plan_s),
        t_learn_s_(params.t_learn_s) {}

  Decision Decide(const Belief& belief, const std::vector<CandidateView>& candidates, const geometry::Rigid& T_world_camera,
                  const motion::Mount& mount, double elapsed_s) final {
    const GainScorer scorer(belief, params_.rule);
    Decision decision;
    decision.completeness = scorer.completeness();
    decision.stop = StopWhateverThereIs(decision.completeness, elapsed_s);
    if (decision.stop != StopReason::kNone) return decision;
    for (const CandidateView& view : candidates) {
      Candidate candidate;
      candidate.view = view;
      candidate.detect_probability = failures_.Factor(view.viewpoint) *
                                     measures::DetectionProbability(belief.views, view.viewpoint, belief.predicted, params_.rule);
      candidate.gain = scorer.Gain(view.viewpoint);
      candidate.t_plan_s = t_plan_s_.mean();
      candidate.t_learn_s = t_learn_s_.mean();
      decision.candidates.push_back(candidate);
    }
    Choose(decision, T_world_camera, mount);
    last_chosen_id_.reset();
    if (decision.chosen >= 0) last_chosen_id_ = decision.candidates[static_cast<std::size_t>(decision.chosen)].view.id;
    return decision;
  }

  void Report(const Attempt& attempt) final {
    if (!(attempt.t_plan_s >= 0.0) || !(attempt.t_learn_s >= 0.0) || !std::isfinite(attempt.t_plan_s + attempt.t_learn_s)) {
      throw std::invalid_argument("an attempt's t_plan_s and t_learn_s must be >= 0 and finite");
    }
    ++attempts_;
    failures_.Note(attempt);
    t_plan_s_.Add(attempt.t_plan_s);
    t_learn_s_.Add(attempt.t_learn_s);
    if (last_chosen_id_) tried_ids_.insert(*last_chosen_id_);
  }

 protected:
  // Sets chosen, or stop, and says in every candidate that was not considered why.
  virtual void Choose(Decision& decision, const geometry::Rigid& T_world_camera, const motion::Mount& mount) const = 0;

  // Worth of the trip before its cost, seconds.
  double ExpectedWorth(const Candidate& candidate) const { return params_.worth_s * candidate.detect_probability * candidate.gain; }

  // Plans the paths to these candidates, together, and completes their costs and utilities.
  void PlanPaths(const std::vector<Candidate*>& candidates, const geometry::Rigid& T_world_camera,
                 const motion::Mount& mount) const {
    std::vector<geometry::Rigid> goals;
    for (const Candidate* candidate : candidates) goals.push_back(candidate->view.T_world_camera);
    std::vector<motion::PathResult> paths = mount.Plan(T_world_camera, goals, DecisionSeed());
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      Candidate& candidate = *candidates[i];
      candidate.refusal = paths[i].refusal;
      candidate.path = std::move(paths[i].trajectory);
      if (!candidate.path) continue;
      candidate.t_move_s = candidate.path->duration_s();
      candidate.utility_s = ExpectedWorth(candidate) - (candidate.t_plan_s + candidate.t_move_s + candidate.t_learn_s);
    }
  }

  bool WasTried(const Candidate& candidate) const { return tried_ids_.count(candidate.view.id) > 0; }

  // Another one after every attempt; the same decision asked for twice is the same decision.
  std::uint32_t DecisionSeed() const { return seed_ + 0x9E3779B9u * static_cast<std::uint32_t>(attempts_); }

  const PlannerParams params_;

 private:
  StopReason StopWhateverThereIs(double completeness, double elapsed_s) const {
    if (completeness >= params_.target_completeness) return StopReason::kTargetReached;
    if (elapsed_s >= params_.time_budget_s) return StopReason::kTimeBudget;
    if (attempts_ >= params_.max_attempts) return StopReason::kMaxAttempts;
    return StopReason::kNone;
  }

  std::uint32_t seed_;
  FailureMemory failures_;
  RunningMean t_plan_s_, t_learn_s_;
  int attempts_ = 0;
  std::optional<int> last_chosen_id_;
  std::set<int> tried_ids_;
};

// The greatest utility (section V-C).
class UtilityStrategy : public SharedStrategy {
 public:
  using SharedStrategy::SharedStrategy;

 protected:
  void Choose(Decision& decision, const geometry::Rigid& T_world_camera, const motion::Mount& mount) const override {
    std::vector<Candidate*> queue;  // Reachable and worth something, best first.
    bool any_pays = false;
    for (Candidate& candidate : decision.candidates) {
      if (candidate.detect_probability < params_.min_detect_probability) {
        candidate.refusal = "too unlikely to detect";
      } else if (candidate.gain <= kNoGain) {
        candidate.refusal = "no gain";
      } else {
        any_pays |= PaysBeforeTheTrip(candidate);
        candidate.refusal = mount.WhyUnreachable(candidate.view.T_world_camera);
        if (candidate.refusal.empty()) queue.push_back(&candidate);
      }
    }
    std::stable_sort(queue.begin(), queue.end(),
                     [this](const Candidate* a, const Candidate* b) { return ExpectedWorth(*a) > ExpectedWorth(*b); });
    const Candidate* best = PlanUntilWorthwhile(queue, T_world_camera, mount);
    if (best != nullptr) {
      decision.chosen = static_cast<int>(best - decision.candidates.data());
      return;
    }
    const bool any_waits = std::any_of(decision.candidates.begin(), decision.candidates.end(), [this](const Candidate& candidate) {
      return candidate.path && PaysBeforeTheTrip(candidate);
    });
    const bool all_refused = decision.candidates.empty() || (any_pays && !any_waits);
    decision.stop = all_refused ? StopReason::kNothingReachable : StopReason::kNothingWorthwhile;
  }

 private:
  bool PaysBeforeTheTrip(const Candidate& candidate) const {
    return ExpectedWorth(candidate) > candidate.t_plan_s + candidate.t_learn_s;
  }

  // Plans paths in batches of max_path_goals: one batch, and further ones while no trip found is worth it but some may be.
  const Candidate* PlanUntilWorthwhile(const std::vector<Candidate*>& queue, const geometry::Rigid& T_world_camera,
                                       const motion::Mount& mount) const {
    const Candidate* best = nullptr;
    const auto batch_size = static_cast<std::size_t>(params_.max_path_goals);
    std::size_t next = 0;
    while (next < queue.size() && best == nullptr && (next == 0 || PaysBeforeTheTrip(*queue[next]))) {
      const std::size_t end = std::min(queue.size(), next + batch_size);
      const std::vector<Candidate*> batch(queue.begin() + static_cast<std::ptrdiff_t>(next),
                                          queue.begin() + static_cast<std::ptrdiff_t>(end));
      PlanPaths(batch, T_world_camera, mount);
      for (const Candidate* candidate : batch) {
        if (candidate->utility_s > (best != nullptr ? best->utility_s : 0.0)) best = candidate;
      }
      next = end;
    }
    for (; next < queue.size(); ++next) queue[next]->refusal = "path not planned";
    return best;
  }
};

// Any reachable candidate that was not tried yet, uniformly: the baseline.
class RandomStrategy : public SharedStrategy {
 public:
  using SharedStrategy::SharedStrategy;

 protected:
  void Choose(Decision& decision, const geometry::Rigid& T_world_camera, const motion::Mount& mount) const override {
    std::vector<Candidate*> urn;
    for (Candidate& candidate : decision.candidates) {
      candidate.refusal = WasTried(candidate) ? "already tried" : mount.WhyUnreachable(candidate.view.T_world_camera);
      if (candidate.refusal.empty()) urn.push_back(&candidate);
    }
    std::mt19937 generator(DecisionSeed());
    while (!urn.empty()) {
      const std::size_t drawn = generator() % urn.size();
      PlanPaths({urn[drawn]}, T_world_camera, mount);
      if (urn[drawn]->path) {
        decision.chosen = static_cast<int>(urn[drawn] - decision.candidates.data());
        return;
      }
      urn.erase(urn.begin() + static_cast<std::ptrdiff_t>(drawn));
    }
    decision.stop = StopReason::kNothingReachable;
  }
};

}  // namespace

std::unique_ptr<Strategy> MakeStrategy(const std::string& name, const PlannerParams& params, std::uint32_t seed) {
  params.Check();
  if (name == "planner") return std::make_unique<UtilityStrategy>(params, seed);
  if (name == "random") return std::make_unique<RandomStrategy>(params, seed);
  throw std::invalid_argument("the strategy must be planner or random, is \"" + name + "\"");
}

}  // namespace vantage::exploration
