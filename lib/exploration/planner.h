// Where to look next: scores candidate views by expected gain minus what the trip costs (section V-C, equation 14), and knows when
// to stop. The caller's loop:
//
//   auto strategy = MakeStrategy("planner", params, seed);
//   while (true) {
//     const Decision decision = strategy->Decide(belief, candidates, stance, mount, elapsed_s);
//     if (decision.chosen < 0) break;  // decision.stop says why.
//     ... move along decision.candidates[decision.chosen].path, try to learn there, bring the belief up to date ...
//     strategy->Report(attempt);
//   }
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "measures/completeness.h"
#include "motion/mount.h"

namespace vantage::exploration {

struct PlannerParams {
  double worth_s = 1500.0;              // Seconds that raising completeness from 0 to 1 is worth to this robot; > 0.
  double target_completeness = 0.97;    // Stop here; (0, 1].
  double min_detect_probability = 0.1;  // Learning attempts less likely than this are not made; [0, 1).
  double attempt_log_odds = 0.7;        // Attempts detect more often than (12) says: the mount tells where to look. First guess of
                                        // by how much, in log odds; finite. Learned from attempts.
  double min_view_angle_rad = 0.24;  // Nearer to a learned view (or to where all was well known), and within a third of an octave
                                     // of its distance, the learner takes no other: such attempts are not made; >= 0.
  double t_plan_s = 0.5;             // First guess of the time one decision takes; >= 0. The mean of...
  double t_learn_s = 1.0;            // ...guess and reports is used. Likewise of one learning attempt.
  double time_budget_s = 900.0;      // Stop when that much robot time has passed; > 0.
  int max_attempts = 60;             // Stop after so many learning attempts; >= 1.
  bool choose_by_rate = true;        // Among views worth their cost: the most utility a second; false: the most utility.
  double failure_radius_rad = 0.17;  // An attempt that added no view though one was wanted lowers the belief in views this near;
                                     // >= 0...
  double failure_discount = 0.3;     // ...by this factor each time, until a view is added from where it matters; [0, 1).
  int max_path_goals = 200;          // Paths are planned for so many candidates at once, greatest worth * P * gain first, and
                                     // for more only while none of those is worth its trip; >= 1.
  measures::CompletenessRule rule = measures::CompletenessRule::kCommonCause;

  void Check() const;  // Throws std::invalid_argument naming the field.
};

// A pose the camera could go to. Candidates come from the world (sampled around the object, or the recorded views).
struct CandidateView {
  int id = 0;  // The caller's own number: the same view of the object keeps it from decision to decision.
  geometry::Rigid T_world_camera = geometry::Rigid::Identity();
  measures::Viewpoint viewpoint;  // The same as seen from the object (object coordinates).
};

// A candidate with everything the decision was made of: a user can see why.
struct Candidate {
  CandidateView view;
  double detect_probability = 0.0;  // P(detect): (12) over the learned views, as attempts bear it out, lowered by failures near by.
  double gain = 0.0;                // Equation (14): completeness with this view added minus completeness now.
  // World; only where it was planned and found. The chosen one is shortened, which may leave t_move_s less than others were told.
  std::optional<motion::Trajectory> path;
  double t_plan_s = 0.0;
  double t_move_s = 0.0;
  double t_learn_s = 0.0;
  // worth_s * P(detect) * gain - (t_plan + t_move + t_learn); -infinity without a path.
  double utility_s = -std::numeric_limits<double>::infinity();
  // Why it was not considered; empty where it was. "too near to a learned view", "too unlikely to detect", "no gain", the mount's
  // words ("in collision", "out of the workspace", "no path found", ...), "path not planned" (see max_path_goals); by baselines
  // also "already tried".
  std::string refusal;
};

enum class StopReason {
  kNone,               // "none": go on.
  kTargetReached,      // "target_reached"
  kNothingWorthwhile,  // "nothing_worth_its_cost"
  kNothingReachable,   // "nothing_reachable": the mount refuses all that would be worth an attempt; baselines: nothing is left.
  kTimeBudget,         // "time_budget"
  kMaxAttempts,        // "max_attempts"
  kOperator            // "operator": never by a strategy; for callers who are told to stop.
};
std::string ToString(StopReason reason);

struct Decision {
  std::vector<Candidate> candidates;  // As given, in the same order; empty where target, time or attempts stop it anyway.
  int chosen = -1;                    // Index into candidates; -1 = stop.
  StopReason stop = StopReason::kNone;
  double completeness = 0.0;  // Now, by params.rule.
};

// What one learning attempt came to.
struct Attempt {
  measures::Viewpoint viewpoint;
  bool detected = false;  // The object was found and tracked there.
  bool view_added = false;
  bool well_known = false;  // The learner's confidence there was so high that it wants no other view.
  double t_plan_s = 0.0;    // What it really took; >= 0.
  double t_learn_s = 0.0;   // Likewise.
  bool looked = true;       // The camera got there: only then the attempt tells of P(detect) and of t_learn_s.
};

// What the planner knows of the object's model.
struct Belief {
  std::vector<measures::Viewpoint> views;  // Learned so far.
  measures::PredictedSuccess predicted;
  std::vector<measures::WeightedViewpoint> reachable;  // p(theta): where the object may be seen from; completeness is over these.
};

// Chooses the next view. Strategies share scores, costs, failure memory and stopping by target, time and attempts (asked in this
// order); they differ in the choice. Same params, seed and calls, same decisions. Not thread-safe.
class Strategy {
 public:
  virtual ~Strategy() = default;

  // Plans from where the mount stands. `elapsed_s` is robot time since the start. Asking again without a Report in between gives
  // the same answer. Cost: candidates x reachable evaluations of (12), 5 ms for 200 x 500, and the mount's planning.
  virtual Decision Decide(const Belief& belief, const std::vector<CandidateView>& candidates, const motion::Stance& stance,
                          const motion::Mount& mount, double elapsed_s) = 0;

  // To be told after every attempt at the view chosen last, also where the camera did not get there or saw nothing. Throws
  // std::invalid_argument where a time is negative or not finite.
  virtual void Report(const Attempt& attempt) = 0;
};

// The truth that only the strategy "oracle" may see: from which views an object is recognised that was learned from one view alone.
struct OutcomeTable {
  std::vector<measures::Viewpoint> viewpoints;
  std::vector<char> detected;  // [learned * viewpoints.size() + seen from] != 0: the right pose was found.

  bool Detected(std::size_t learned, std::size_t from) const { return detected[learned * viewpoints.size() + from] != 0; }
  // Index of the viewpoint with the nearest direction. Throws std::logic_error where there are none.
  std::size_t Nearest(const measures::Viewpoint& viewpoint) const;
  void Check() const;  // Throws std::invalid_argument where it is empty or not square.
};

// Strategies by name; all but the planner and the oracle never stop for cost: baselines.
//   planner   of the views whose utility is > 0 the best (choose_by_rate says how); stops where there is none.
//   random    any reachable candidate whose id was not tried yet, uniformly; does not ask min_detect_probability.
//   nearest   of those not tried, the one that takes the least time to reach.
//   sweep     round the object in steps of 20 degrees at 3 elevations, from where the camera is at first, always to the untried
//             candidate nearest to the next step.
//   coverage  of those not tried and likely enough to be detected (min_detect_probability; where none is: of all), the one
//             furthest in direction from all views learned and tried.
//   oracle    as the planner, but P(detect) and gain are what `outcomes` says; needs it.
// Throws std::invalid_argument on another name, for an oracle without outcomes, and what params.Check() and outcomes->Check()
// throw. `outcomes` must outlive the strategy.
std::unique_ptr<Strategy> MakeStrategy(const std::string& name, const PlannerParams& params, std::uint32_t seed,
                                       const OutcomeTable* outcomes = nullptr);
const std::vector<std::string>& StrategyNames();

// Candidate views around an object: even directions between the elevations times the distances, looking at the object's origin,
// image up towards +z of the world. Directions are even in the object's coordinates and ids name direction and distance, so a
// better pose of the object moves the candidates but keeps their ids; elevations are the world's.
struct CandidateParams {
  int directions = 120;                     // >= 1, over the whole sphere before the elevation cut.
  double min_elevation_rad = 0.17;          // Above the world's horizontal; [-pi/2, max_elevation_rad].
  double max_elevation_rad = 1.4;           // <= pi/2.
  std::vector<double> distances_m = {0.6};  // At least one, each > 0.

  void Check() const;  // Throws std::invalid_argument naming the field.
};
std::vector<CandidateView> SampleCandidates(const geometry::Rigid& T_world_object, const CandidateParams& params);

// The viewpoint of a camera pose relative to an object. Throws std::invalid_argument where the camera is at the object's origin.
measures::Viewpoint ViewpointOf(const geometry::Rigid& T_world_camera, const geometry::Rigid& T_world_object);

}  // namespace vantage::exploration
