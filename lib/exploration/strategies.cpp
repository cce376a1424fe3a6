#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "exploration/shared_strategy.h"
#include "geometry/rigid.h"

namespace vantage::exploration {
namespace {

constexpr double kNoGain = 1e-9;
constexpr double kSameDistance_octaves = 1.0 / 3.0;  // As the learner has it.

// The utility of section V-C.
class UtilityStrategy : public SharedStrategy {
 public:
  using SharedStrategy::SharedStrategy;

 protected:
  void Choose(const Belief& belief, Decision& decision, const motion::Stance& stance, const motion::Mount& mount) const override {
    if (belief.reachable.empty() && AllRefused(decision, mount)) return;
    std::vector<Candidate*> queue;  // Reachable and worth something, best first.
    bool any_pays = false;
    for (Candidate& candidate : decision.candidates) {
      if (IsTooNear(candidate.view.viewpoint, belief)) {
        candidate.refusal = "too near to a learned view";
      } else if (candidate.detect_probability < params_.min_detect_probability) {
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
    const Candidate* best = PlanUntilWorthwhile(queue, stance, mount);
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
  bool IsTooNear(const measures::Viewpoint& place, const Belief& belief) const {
    const auto is_near = [&](const measures::Viewpoint& view) {
      return geometry::AngleBetween(view.direction, place.direction) < params_.min_view_angle_rad &&
             std::abs(std::log2(view.distance_m / place.distance_m)) < kSameDistance_octaves;
    };
    return std::any_of(belief.views.begin(), belief.views.end(), is_near) ||
           std::any_of(well_known().begin(), well_known().end(), is_near);
  }

  // Without any place to see the object from, no view gains anything: the mount's words are the better reason.
  static bool AllRefused(Decision& decision, const motion::Mount& mount) {
    for (Candidate& candidate : decision.candidates) {
      candidate.refusal = mount.WhyUnreachable(candidate.view.T_world_camera);
      if (candidate.refusal.empty()) return false;
    }
    decision.stop = StopReason::kNothingReachable;
    return true;
  }

  // What is not learned now can be learned later: by utility alone it would criss-cross the sphere and pass by what lies on the
  // way.
  double Rate(const Candidate& candidate) const {
    if (!params_.choose_by_rate) return candidate.utility_s;
    return candidate.utility_s / (candidate.t_plan_s + candidate.t_move_s + candidate.t_learn_s);
  }

  bool PaysBeforeTheTrip(const Candidate& candidate) const {
    return ExpectedWorth(candidate) > candidate.t_plan_s + candidate.t_learn_s;
  }

  // Plans paths in batches of max_path_goals: one batch, and further ones while no trip found is worth it but some may be.
  const Candidate* PlanUntilWorthwhile(const std::vector<Candidate*>& queue, const motion::Stance& stance,
                                       const motion::Mount& mount) const {
    const Candidate* best = nullptr;
    const auto batch_size = static_cast<std::size_t>(params_.max_path_goals);
    std::size_t next = 0;
    while (next < queue.size() && best == nullptr && (next == 0 || PaysBeforeTheTrip(*queue[next]))) {
      const std::size_t end = std::min(queue.size(), next + batch_size);
      const std::vector<Candidate*> batch(queue.begin() + static_cast<std::ptrdiff_t>(next),
                                          queue.begin() + static_cast<std::ptrdiff_t>(end));
      PlanPaths(batch, stance, mount);
      for (const Candidate* candidate : batch) {
        if (candidate->utility_s > 0.0 && (best == nullptr || Rate(*candidate) > Rate(*best))) best = candidate;
      }
      next = end;
    }
    for (; next < queue.size(); ++next) queue[next]->refusal = "path not planned";
    return best;
  }
};

// The planner, told the truth: what each view would bring.
class OracleStrategy : public UtilityStrategy {
 public:
  OracleStrategy(const PlannerParams& params, std::uint32_t seed, const OutcomeTable& outcomes)
      : UtilityStrategy(params, seed), outcomes_(outcomes) {}

 protected:
  void Score(const Belief& belief, const GainScorer& /*scorer*/, std::vector<Candidate>& candidates) const override {
    const std::size_t count = outcomes_.viewpoints.size();
    std::vector<char> covered(count, 0);
    for (const measures::Viewpoint& view : belief.views) {
      const std::size_t learned = outcomes_.Nearest(view);
      for (std::size_t i = 0; i < count; ++i) covered[i] |= outcomes_.detected[learned * count + i];
    }
    for (Candidate& candidate : candidates) {
      const std::size_t here = outcomes_.Nearest(candidate.view.viewpoint);
      std::size_t won = 0;
      for (std::size_t i = 0; i < count; ++i) won += outcomes_.Detected(here, i) && !covered[i];
      candidate.gain = static_cast<double>(won) / static_cast<double>(count);
      candidate.detect_probability = FailureFactor(candidate.view.viewpoint) * (covered[here] != 0 ? 1.0 : 0.0);
    }
  }

 private:
  const OutcomeTable& outcomes_;
};

}  // namespace

std::size_t OutcomeTable::Nearest(const measures::Viewpoint& viewpoint) const {
  if (viewpoints.empty()) throw std::logic_error("an outcome table without viewpoints has no nearest one");
  const auto nearest =
      std::max_element(viewpoints.begin(), viewpoints.end(), [&](const measures::Viewpoint& a, const measures::Viewpoint& b) {
        return a.direction.dot(viewpoint.direction) < b.direction.dot(viewpoint.direction);
      });
  return static_cast<std::size_t>(nearest - viewpoints.begin());
}

void OutcomeTable::Check() const {
  if (viewpoints.empty() || detected.size() != viewpoints.size() * viewpoints.size()) {
    throw std::invalid_argument("an outcome table needs viewpoints and an outcome for each pair of them, has " +
                                std::to_string(viewpoints.size()) + " and " + std::to_string(detected.size()));
  }
}

const std::vector<std::string>& StrategyNames() {
  static const std::vector<std::string> names{"planner", "random", "nearest", "sweep", "coverage", "oracle"};
  return names;
}

std::unique_ptr<Strategy> MakeStrategy(const std::string& name, const PlannerParams& params, std::uint32_t seed,
                                       const OutcomeTable* outcomes) {
  params.Check();
  if (name == "planner") return std::make_unique<UtilityStrategy>(params, seed);
  if (name == "oracle") {
    if (outcomes == nullptr) throw std::invalid_argument("the strategy oracle needs a table of outcomes");
    outcomes->Check();
    return std::make_unique<OracleStrategy>(params, seed, *outcomes);
  }
  if (auto baseline = MakeBaseline(name, params, seed)) return baseline;
  std::string known;
  for (const std::string& each : StrategyNames()) known += (known.empty() ? "" : ", ") + each;
  throw std::invalid_argument("the strategy must be one of " + known + ", is \"" + name + "\"");
}

}  // namespace vantage::exploration
