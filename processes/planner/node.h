// The planner: decides where to look next, sends the mount there, waits for what the learner makes of it, and knows when to stop.
#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "exploration/planner.h"
#include "messaging/assessor_messages.h"
#include "messaging/learner_messages.h"
#include "messaging/mount_messages.h"
#include "messaging/node.h"
#include "messaging/planner_messages.h"
#include "session/attempt.h"

namespace vantage::planner {

struct PlannerNodeParams {
  std::string strategy = "planner";  // "planner", "random", "nearest", "sweep" or "coverage".
  std::uint32_t seed = 0;
  double wait_s = 90.0;           // Where there is still no object to explore after so long, the run ends; > 0.
  double measures_wait_s = 60.0;  // The first decision and a decision to stop wait at most so long for measures of all views; >= 0.
  int max_unmeasured_views =
      3;  // So many views may be without measures when a decision is made; more are waited for likewise; >= 0.
  double time_limit_s = 420.0;    // The run ends after this time since the first decision, whatever the strategy's budget; > 0.
  double settle_s = 0.1;          // Frames captured less than this after arrival do not count; >= 0.
  int look_frames = 3;            // An attempt ends when the learner has looked at so many frames...
  double look_s = 6.0;            // ...or after this time; > 0.
  double silence_s = 4.0;         // Mount or learner silent for longer: the planner waits for them; > 0.
  double resend_s = 0.5;          // A command the mount does not acknowledge is sent again; > 0.
  int max_refusals = 3;           // A way the mount refuses so often in a row counts as a failed attempt; >= 1.
  double publish_period_s = 1.0;  // PLANNER_REACH and PLANNER_PLAN are sent again so often; > 0.
  double table_size_m = 2.0;      // The table is taken for this large, and solid down to the floor; > 0.
  double table_height_m = 0.75;   // Above the floor; > 0.
  std::string summary;            // A JSON file to write at the end; empty: none.
  bool exit_when_done = false;    // The process ends with the run.
  session::LearnerWants learner;  // What an attempt came to is judged by these.
  exploration::PlannerParams planner;
  exploration::CandidateParams candidates;
  motion::MountParams mount;

  void Check() const;  // Throws std::invalid_argument naming the field.
};

// `config_file`: the fields above but the last four, which are in `library_file`. Either may be empty. Throws std::runtime_error.
PlannerNodeParams LoadPlannerNodeParams(const std::string& config_file, const std::string& library_file);

class PlannerNode : public messaging::Node {
 public:
  PlannerNode(messaging::Bus& bus, const PlannerNodeParams& params);

  void Step() override;
  std::int64_t NextStep_us() const override { return next_step_us_; }
  bool Finished() const override { return phase_ == Phase::kDone && params_.exit_when_done; }

  bool done() const { return phase_ == Phase::kDone; }
  const messaging::PlanStatus& status() const { return status_; }
  // Obstacles and candidates of the last decision.
  const motion::Obstacles& obstacles() const { return obstacles_; }

 protected:
  std::string State() const override { return status_.state; }
  std::string Detail() const override;

 private:
  enum class Phase { kWaiting, kMoving, kLooking, kDone };

  // What came of the frames captured since the arrival.
  struct Look {
    std::int64_t arrived_us = 0;
    std::int64_t since_us = 0;  // By our clock.
    int frames = 0;
    exploration::Attempt seen;  // In them.
    bool view_coming = false;   // The learner has a new view; LEARNER_VIEW says when it is durable.
    std::string note;
  };

  void OnTrack(const track_t& message);
  void OnView(const view_t& message);
  void OnMeasures(const measures_t& message);
  void OnCompleteness(const completeness_t& message);

  // What a decision cannot be made without; empty where all is there.
  std::string Missing() const;
  void Wait(const std::string& why);
  void Plan();
  void ListCandidates();
  void UpdateObstacles();
  bool StopIsCertain(exploration::StopReason reason) const;
  bool Patient() const;
  void SendCommand();
  void Move();
  void LookAround();
  void EndAttempt(bool reached);
  void Finish(const std::string& reason);
  void Publish();
  void WriteSummary() const;

  bool Fresh(std::int64_t heard_us) const;
  double ElapsedSince(std::int64_t utime) const { return 1e-6 * static_cast<double>(now_us() - utime); }
  double BudgetS() const { return std::min(params_.planner.time_budget_s, params_.time_limit_s); }
  int views() const { return static_cast<int>(belief_.views.size()); }

  PlannerNodeParams params_;
  std::unique_ptr<exploration::Strategy> strategy_;

  // What was heard.
  std::optional<messaging::MountState> mount_state_;
  std::optional<messaging::Scene> scene_;
  std::optional<geometry::Rigid> T_world_object_;
  std::string object_;
  std::string store_;
  std::int64_t mount_heard_us_ = 0;
  std::int64_t track_heard_us_ = 0;
  int measured_views_ = 0;  // Whose trials are in the measures.
  exploration::Belief belief_;

  // Where the run stands.
  Phase phase_ = Phase::kWaiting;
  messaging::PlanStatus status_;
  std::string waiting_for_;
  std::int64_t waiting_since_us_ = 0;
  std::int64_t progress_us_ = 0;         // When views or measures were last heard to have grown.
  std::optional<int> stop_considered_;   // The measured views a decision to stop was made with...
  std::int64_t stop_considered_us_ = 0;  // ...and when it was made first.
  std::int64_t first_decision_us_ = 0;
  motion::MountMaker mounts_;
  motion::Obstacles obstacles_;
  std::vector<exploration::CandidateView> candidates_;
  std::optional<exploration::Decision> decision_;
  mount_command_t command_;
  std::int64_t command_sent_us_ = 0;
  int refusals_ = 0;
  int views_at_departure_ = 0;
  double plan_s_ = 0.0;  // Of the last decision.
  Look look_;
  double total_plan_s_ = 0.0;
  double total_move_s_ = 0.0;
  double total_learn_s_ = 0.0;
  std::int64_t next_step_us_ = 0;
  std::int64_t next_publish_us_ = 0;
};

}  // namespace vantage::planner
