// The closed loop in lock step on a virtual clock: look, learn, assess, decide, move, until the strategy stops.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "assessment/assessor.h"
#include "exploration/planner.h"
#include "learning/learner.h"
#include "model/store.h"
#include "motion/mount.h"
#include "motion/path_audit.h"
#include "session/judge.h"
#include "simulation/world.h"

namespace vantage::session {

struct ExploreParams {
  learning::LearnerParams learner;
  exploration::PlannerParams planner;
  exploration::CandidateParams candidates;  // Where any pose can be taken; a recorded world has its own.
  motion::MountParams mount;
  assessment::TrialParams trials;
  std::string strategy = "planner";  // A name of exploration::StrategyNames().
  // What the strategy "oracle" knows; null for the others. Must outlive the run.
  const exploration::OutcomeTable* outcomes = nullptr;
  int max_backgrounds = 8;  // Own frames, objects masked, that virtual views are pasted over; >= 0.
  // Judge the model after every view, not only, by all judging views, at the end: by the first judge_views_over_time of them, and
  // of these only by such as see it from less than judge_within_deg of the new view, or where it was not detected so far from less
  // than judge_reach_deg, as little changes for the others. 180 = all.
  bool judge_over_time = true;
  int judge_views_over_time = 0;   // >= 0; 0 = all.
  double judge_within_deg = 30.0;  // (0, 180].
  double judge_reach_deg = 75.0;   // [judge_within_deg, 180].
  std::uint32_t seed = 0;

  void Check() const;  // Throws std::invalid_argument naming the field.
};

struct ExploreTime {
  double plan_s = 0.0;
  double move_s = 0.0;
  double learn_s = 0.0;
  double total_s() const { return plan_s + move_s + learn_s; }
};

// What the second opinion (motion/path_audit.h) says of all paths that were executed, against what is truly there: furniture, the
// hulls of all objects, and the obstacles the planner knew of.
struct ExploreAudit {
  int paths = 0;
  int touching = 0;
  double clearance_m = motion::kFarAudit_m;  // The least of all.
  std::string obstacle;                      // To what.
};

// One attempt as it was decided on and what came of it.
struct ExploreAttempt {
  double time_s = 0.0;              // Robot time when it was over.
  double predicted = 0.0;           // (12) over the views learned before, and...
  double detect_probability = 0.0;  // ...what the strategy made of it.
  double gain = 0.0;
  double nearest_view_rad = 0.0;  // Angle to the nearest learned view.
  double move_s = 0.0;
  bool detected = false, view_added = false;
  std::string note;  // The learner's.
};

struct ExploreResult {
  std::string strategy;
  std::uint32_t seed = 0;
  int views = 0;
  int attempts = 0;
  int failed_attempts = 0;  // That added no view.
  ExploreTime time;         // Robot time: the planner's assumed costs and the timed paths.
  double completeness = 0.0;
  std::vector<std::pair<double, double>> completeness_over_time;  // (robot time s, completeness), after every view.
  std::vector<std::pair<double, double>> true_rate_over_time;     // Likewise; empty where not judged.
  std::optional<double> true_detection_rate;
  std::string stop_reason;
  std::vector<ExploreAttempt> log;
  ExploreAudit audit;
  std::shared_ptr<const model::ObjectModel> object;  // Null where no object was found at the start.
};

// Progress, for people: called after the first view and every attempt.
struct ExploreStep {
  double time_s = 0.0;
  int attempt = 0;
  int views = 0;
  double completeness = 0.0;
  std::string note;  // What the attempt came to.
  const exploration::Decision* decision = nullptr;
};

// Where the loop begins.
struct ExploreStart {
  geometry::Rigid T_world_camera = geometry::Rigid::Identity();
  learning::Target target;
  std::string object_name = "object";
  geometry::Rigid T_world_mesh = geometry::Rigid::Identity();  // The truth, for the judge alone.
};

// `judge` and `store` may be null. Every view is in the store as soon as it is learned.
// Throws std::runtime_error where no object is found from the start pose.
ExploreResult Explore(const simulation::World& world, const ExploreStart& start, const ExploreParams& params, const Judge* judge,
                      model::Store* store, const std::function<void(const ExploreStep&)>& progress = {});

}  // namespace vantage::session
