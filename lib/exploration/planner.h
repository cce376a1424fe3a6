// Where to look next: scores candidate views by expected gain minus what the trip costs (section V-C, equation 14), and knows when
// to stop.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "measures/completeness.h"
#include "motion/mount.h"

namespace vantage::exploration {

struct PlannerParams {
  double worth_s = 600.0;                // Seconds a full unit of detection probability is worth to this robot; > 0.
  double target_completeness = 0.97;     // Stop here; (0, 1].
  double min_detect_probability = 0.25;  // Learning attempts less likely than this are not made; [0, 1).
  double t_plan_s = 0.5;                 // First guess of the time one decision takes; >= 0.
  double t_learn_s = 1.0;                // First guess of the time one learning attempt takes; >= 0.
  double time_budget_s = 900.0;          // Stop when that much robot time has passed; > 0.
  int max_attempts = 60;                 // Stop after so many learning attempts; >= 1.
  double failure_radius_rad = 0.17;      // A failed attempt lowers the belief in views this near to it...
  double failure_discount = 0.3;         // ...by this factor each time, until the model changes; [0, 1).
  int max_path_goals = 200;              // Only so many candidates (best expected gain first) get their path planned; >= 1.
  measures::CompletenessRule rule = measures::CompletenessRule::kMax;

  void Check() const;  // Throws std::invalid_argument naming the field.
};

// A pose the camera could go to. Candidates come from the world (sampled around the object, or the recorded views).
struct CandidateView {
  int id = 0;  // The caller's own number.
  geometry::Rigid T_world_camera = geometry::Rigid::Identity();
  measures::Viewpoint viewpoint;  // The same as seen from the object (object coordinates).
};

// A candidate with everything the decision was made of: a user can see why.
struct Candidate {
  CandidateView view;
  double detect_probability = 0.0;  // Equation (12), lowered by failures near by.
  double gain = 0.0;                // Equation (14): completeness with this view added minus completeness now.
  std::optional<motion::Trajectory> path;
  double t_plan_s = 0.0;
  double t_move_s = 0.0;
  double t_learn_s = 0.0;
  double utility_s = -std::numeric_limits<double>::infinity();  // worth * P(detect) * gain - (t_plan + t_move + t_learn).
  std::string refusal;                                          // Why it was not considered; empty where it was.
};

enum class StopReason { kNone, kTargetReached, kNothingWorthwhile, kNothingReachable, kTimeBudget, kMaxAttempts, kOperator };
std::string ToString(StopReason reason);  // "target_reached", "nothing_worth_its_cost", "nothing_reachable", ...

struct Decision {
  std::vector<Candidate> candidates;
  int chosen = -1;  // Index into candidates; -1 = stop.
  StopReason stop = StopReason::kNone;
  double completeness = 0.0;  // Now, by params.rule.
};

// What one learning attempt came to.
struct Attempt {
  measures::Viewpoint viewpoint;
  bool detected = false;  // The object was found and tracked there.
  bool view_added = false;
  double t_plan_s = 0.0;  // What it really took.
  double t_learn_s = 0.0;
};

// What the planner knows of the object's model.
struct Belief {
  std::vector<measures::Viewpoint> views;  // Learned so far.
  measures::PredictedSuccess predicted;
  std::vector<measures::WeightedViewpoint> reachable;  // p(theta): where the object may be seen from.
};

// Chooses the next view. Strategies share candidates, paths, failure memory and stopping by time; they differ in the choice.
class Strategy {
 public:
  virtual ~Strategy() = default;

  // Plans from where the camera is. `elapsed_s` is robot time since the start.
  virtual Decision Decide(const Belief& belief, const std::vector<CandidateView>& candidates, const geometry::Rigid& T_world_camera,
                          const motion::Mount& mount, double elapsed_s) = 0;

  // Told after every attempt.
  virtual void Report(const Attempt& attempt) = 0;
};

// "planner": utility as above. "random": any reachable candidate not yet tried, uniformly (same budget, same target; never stops
// for cost). Throws std::invalid_argument on another name.
std::unique_ptr<Strategy> MakeStrategy(const std::string& name, const PlannerParams& params, std::uint32_t seed);

// Candidate views around an object: `count` even directions between the elevations times the distances, looking at the object's
// centre, image up towards +z of the world.
struct CandidateParams {
  int directions = 120;             // >= 1, over the whole sphere before the elevation cut.
  double min_elevation_rad = 0.17;  // Above the table plane.
  double max_elevation_rad = 1.4;
  std::vector<double> distances_m = {0.6};  // Each > 0.

  void Check() const;
};
std::vector<CandidateView> SampleCandidates(const geometry::Rigid& T_world_object, const CandidateParams& params);

// The viewpoint of a camera pose relative to an object.
measures::Viewpoint ViewpointOf(const geometry::Rigid& T_world_camera, const geometry::Rigid& T_world_object);

}  // namespace vantage::exploration
