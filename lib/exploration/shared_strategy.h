// What all strategies do the same way; they differ in Choose. Internal to exploration.
#pragma once

#include <set>

#include "exploration/planner.h"
#include "exploration/scoring.h"

namespace vantage::exploration {

class SharedStrategy : public Strategy {
 public:
  SharedStrategy(const PlannerParams& params, std::uint32_t seed);

  Decision Decide(const Belief& belief, const std::vector<CandidateView>& candidates, const motion::Stance& stance,
                  const motion::Mount& mount, double elapsed_s) final;
  void Report(const Attempt& attempt) final;

 protected:
  // Sets chosen, or stop, and says in every candidate that was not considered why.
  virtual void Choose(const Belief& belief, Decision& decision, const motion::Stance& stance, const motion::Mount& mount) const = 0;
  // P(detect) and gain of all candidates; a strategy may know better than the belief.
  virtual void Score(const Belief& belief, const GainScorer& scorer, std::vector<Candidate>& candidates) const;

  // Worth of the trip before its cost, seconds.
  double ExpectedWorth(const Candidate& candidate) const { return params_.worth_s * candidate.detect_probability * candidate.gain; }

  // Plans the paths to these candidates, together, and completes their costs and utilities.
  void PlanPaths(const std::vector<Candidate*>& candidates, const motion::Stance& stance, const motion::Mount& mount) const;

  // Those that were not tried and that the mount does not refuse; the others are told why.
  std::vector<Candidate*> Untried(Decision& decision, const motion::Mount& mount) const;
  // Goes to the first of the queue that a path leads to; stops where there is none.
  void GoToFirst(const std::vector<Candidate*>& queue, Decision& decision, const motion::Stance& stance,
                 const motion::Mount& mount) const;

  double FailureFactor(const measures::Viewpoint& view) const { return failures_.Factor(view); }
  const std::vector<measures::Viewpoint>& attempted() const { return attempted_; }  // All that were reported.
  // Where the learner wanted no view: there is nothing to learn.
  const std::vector<measures::Viewpoint>& well_known() const { return well_known_; }

  // Another one after every attempt; the same decision asked for twice is the same decision.
  std::uint32_t DecisionSeed() const { return seed_ + 0x9E3779B9u * static_cast<std::uint32_t>(attempted_.size()); }

  const PlannerParams params_;

 private:
  void SetCosts(Candidate& candidate) const;  // From its path.
  StopReason StopWhateverThereIs(double completeness, double elapsed_s) const;

  std::uint32_t seed_;
  FailureMemory failures_;
  AttemptOdds odds_;
  RunningMean t_plan_s_, t_learn_s_;
  std::vector<measures::Viewpoint> attempted_, well_known_;
  std::optional<int> last_chosen_id_;
  double last_predicted_ = 0.0;  // (12) at the view chosen last.
  std::set<int> tried_ids_;
};

// Strategies to compare the planner with (baselines.cpp); nullptr where there is none of that name.
std::unique_ptr<Strategy> MakeBaseline(const std::string& name, const PlannerParams& params, std::uint32_t seed);

}  // namespace vantage::exploration
