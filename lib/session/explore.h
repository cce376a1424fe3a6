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
  int max_backgrounds = 8;      // Own frames, objects masked, that virtual views are pasted over; >= 0.
  bool judge_over_time = true;  // Judge the model on the way, not only at the end...
  int judge_every_views = 1;    // ...after every so many views; >= 1.
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
