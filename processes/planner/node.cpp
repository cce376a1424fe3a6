#include "planner/node.h"

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <vantage/operator_command_t.hpp>

#include "messaging/channels.h"

namespace vantage::planner {
namespace {

constexpr std::int64_t kStep_us = 50000;

// The table as a solid block under its plane, wide around the object.
motion::BoxObstacle TableBelow(const segmentation::Plane& plane, const Eigen::Vector3d& object_in_world, double size_m,
                               double height_m) {
  const Eigen::Vector3d foot = object_in_world - plane.Height(object_in_world) * plane.normal;
  motion::BoxObstacle table;
  table.name = "table";
  table.T_world_box.linear() = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), plane.normal).toRotationMatrix();
  table.T_world_box.translation() = foot - 0.5 * height_m * plane.normal;
  table.size_m = {size_m, size_m, height_m};
  return table;
}

motion::Trajectory ForMount(motion::Trajectory camera_path, const geometry::Rigid& T_mount_camera) {
  const geometry::Rigid T_camera_mount = T_mount_camera.inverse();
  for (auto& waypoint : camera_path.waypoints) waypoint.T_world_mount = waypoint.T_world_mount * T_camera_mount;
  return camera_path;
}

}  // namespace

PlannerNode::PlannerNode(messaging::Bus& bus, const PlannerNodeParams& params)
    : Node(bus, "planner"),
      params_((params.Check(), params)),
      strategy_(exploration::MakeStrategy(params.strategy, params.planner, params.seed)),
      mounts_(params.mount) {
  status_.run_id = now_us();
  status_.state = "waiting";
  status_.target_completeness = params_.planner.target_completeness;
  waiting_since_us_ = now_us();
  SubscribeInOrder<mount_state_t>(messaging::kMountState, [this](const mount_state_t& message) {
    const auto state = messaging::FromMessage(message);
    if (!state) return Refuse(messaging::kMountState, state.error);
    mount_state_ = *state;
    mount_heard_us_ = now_us();
  });
  SubscribeInOrder<scene_t>(messaging::kLearnerScene, [this](const scene_t& message) {
    const auto scene = messaging::FromMessage(message);
    if (!scene) return Refuse(messaging::kLearnerScene, scene.error);
    scene_ = *scene;
  });
  SubscribeInOrder<track_t>(messaging::kLearnerTrack, [this](const track_t& message) { OnTrack(message); });
  SubscribeInOrder<view_t>(messaging::kLearnerView, [this](const view_t& message) { OnView(message); });
  Subscribe<measures_t>(messaging::kAssessorMeasures, [this](const measures_t& message) { OnMeasures(message); });
  Subscribe<completeness_t>(messaging::kAssessorCompleteness, [this](const completeness_t& message) { OnCompleteness(message); });
  Subscribe<operator_command_t>(messaging::kOperatorCommand, [this](const operator_command_t& message) {
    if (message.command != "stop" || phase_ == Phase::kDone) return;
    if (message.process.empty() || message.process == process()) Finish(exploration::ToString(exploration::StopReason::kOperator));
  });
}

std::string PlannerNode::Detail() const {
  if (phase_ == Phase::kDone) return status_.stop_reason;
  if (phase_ == Phase::kWaiting) return waiting_for_.empty() ? "" : "for " + waiting_for_;
  return std::to_string(views()) + " views, attempt " + std::to_string(status_.attempts + 1);
}

bool PlannerNode::Fresh(std::int64_t heard_us) const { return heard_us > 0 && ElapsedSince(heard_us) <= params_.silence_s; }

void PlannerNode::OnTrack(const track_t& message) {
  const auto track = messaging::FromMessage(message);
  if (!track) return Refuse(messaging::kLearnerTrack, track.error);
  track_heard_us_ = now_us();
  object_ = track->object;
  if (track->T_world_object) T_world_object_ = track->T_world_object;
  if (phase_ != Phase::kLooking) return;
  if (track->utime < look_.arrived_us + static_cast<std::int64_t>(params_.settle_s * 1e6)) return;
  ++look_.frames;
  session::NoteFrame(track->result, params_.learner, look_.seen);
  look_.view_coming |= track->result.view_added;
  look_.note = track->result.note;
}

void PlannerNode::OnView(const view_t& message) {
  const auto view = messaging::FromMessage(message);
  if (!view) return Refuse(messaging::kLearnerView, view.error);
  if (!object_.empty() && view->object != object_) return;
  store_ = view->store;
  if (views() + 1 != view->views) return;  // Doubled, or some were missed: the assessor tells of all of them.
  belief_.views.push_back(view->viewpoint);
  progress_us_ = now_us();
}

void PlannerNode::OnMeasures(const measures_t& message) {
  const auto measures = messaging::FromMessage(message);
  if (!measures) return Refuse(messaging::kAssessorMeasures, measures.error);
  if (measures->object != object_) return;
  belief_.predicted = measures->measures.predicted;
  if (measures->views != measured_views_) progress_us_ = now_us();
  measured_views_ = measures->views;
}

void PlannerNode::OnCompleteness(const completeness_t& message) {
  const auto completeness = messaging::FromMessage(message);
  if (!completeness) return Refuse(messaging::kAssessorCompleteness, completeness.error);
  if (completeness->object != object_ || static_cast<int>(completeness->views.size()) <= views()) return;
  belief_.views = completeness->views;
  progress_us_ = now_us();
}

std::string PlannerNode::Missing() const {
  if (!Fresh(mount_heard_us_)) return "the mount (MOUNT_STATE)";
  if (!Fresh(track_heard_us_)) return "the learner (LEARNER_TRACK)";
  if (mount_state_->moving) return "the mount to come to rest";
  if (!T_world_object_) return "an object on the table";
  if (!scene_) return "the scene (LEARNER_SCENE)";
  if (views() == 0) return "the first view";
  if (measured_views_ == 0 && Patient()) return "measures of the first view (ASSESSOR_MEASURES)";
  if (stop_considered_) {
    const bool same = *stop_considered_ == measured_views_;
    return same && ElapsedSince(stop_considered_us_) < params_.measures_wait_s ? "measures of all views, before it stops" : "";
  }
  if (views() - measured_views_ > params_.max_unmeasured_views && Patient()) return "measures of the newest views";
  return "";
}

bool PlannerNode::Patient() const { return ElapsedSince(std::max(progress_us_, waiting_since_us_)) < params_.measures_wait_s; }

void PlannerNode::Wait(const std::string& why) {
  if (phase_ != Phase::kWaiting) waiting_since_us_ = now_us();
  phase_ = Phase::kWaiting;
  status_.state = "waiting";
  waiting_for_ = why;
}

void PlannerNode::Step() {
  next_step_us_ = now_us() + kStep_us;
  status_.views = views();
  switch (phase_) {
    case Phase::kWaiting: {
      const std::string missing = Missing();
      if (missing.empty()) {
        Plan();
      } else {
        Wait(missing);
        const bool begun = status_.decision > 0;
        if (!begun && ElapsedSince(waiting_since_us_) > params_.wait_s) Finish("nothing_to_explore");
        if (begun && ElapsedSince(first_decision_us_) > BudgetS()) {
          Finish(exploration::ToString(exploration::StopReason::kTimeBudget));
        }
      }
      break;
    }
    case Phase::kMoving:
      Move();
      break;
    case Phase::kLooking:
      LookAround();
      break;
    case Phase::kDone:
      break;
  }
  if (now_us() >= next_publish_us_) Publish();
}

void PlannerNode::UpdateObstacles() {
  obstacles_ = motion::Obstacles();
  obstacles_.hulls = scene_->hulls;
  if (scene_->plane) {
    obstacles_.boxes.push_back(
        TableBelow(*scene_->plane, T_world_object_->translation(), params_.table_size_m, params_.table_height_m));
  }
}

void PlannerNode::ListCandidates() {
  UpdateObstacles();
  if (candidates_.empty()) candidates_ = exploration::SampleCandidates(*T_world_object_, params_.candidates);
}

// A stop is believed only with measures of all views: a fit of fewer is too modest, or too bold.
bool PlannerNode::StopIsCertain(exploration::StopReason reason) const {
  if (reason == exploration::StopReason::kTimeBudget || reason == exploration::StopReason::kMaxAttempts) return true;
  return measured_views_ >= views() || (stop_considered_ && ElapsedSince(stop_considered_us_) >= params_.measures_wait_s);
}

void PlannerNode::Plan() {
  const messaging::Stopwatch stopwatch(bus_);
  if (first_decision_us_ == 0) first_decision_us_ = now_us();
  ListCandidates();
  const auto mount = mounts_.Make(obstacles_);
  belief_.reachable.clear();
  for (const auto& candidate : candidates_) {
    if (mount->WhyUnreachable(candidate.T_world_camera).empty()) belief_.reachable.push_back({candidate.viewpoint, 1.0});
  }
  if (ElapsedSince(first_decision_us_) > BudgetS()) return Finish(exploration::ToString(exploration::StopReason::kTimeBudget));
  decision_ = strategy_->Decide(belief_, candidates_, {mount_state_->T_world_camera(), mount_state_->joints_rad}, *mount,
                                ElapsedSince(first_decision_us_));
  plan_s_ = 1e-3 * stopwatch.ms();
  total_plan_s_ += plan_s_;
  status_.completeness = decision_->completeness;
  if (decision_->chosen < 0) {
    if (!StopIsCertain(decision_->stop)) {
      if (!stop_considered_) stop_considered_us_ = now_us();
      stop_considered_ = measured_views_;
      return;
    }
    ++status_.decision;
    return Finish(exploration::ToString(decision_->stop));
  }
  stop_considered_.reset();
  ++status_.decision;
  Count("decisions");
  const auto& chosen = decision_->candidates[static_cast<std::size_t>(decision_->chosen)];
  command_ = messaging::ToMessage(ForMount(*chosen.path, mount_state_->T_mount_camera), now_us(), now_us());
  status_.command_id = command_.command_id;
  status_.state = "moving";
  phase_ = Phase::kMoving;
  views_at_departure_ = views();
  SendCommand();
  Publish();
}

void PlannerNode::SendCommand() {
  command_sent_us_ = now_us();
  bus_.Publish(messaging::kMountCommand, command_);
}

void PlannerNode::Move() {
  if (!Fresh(mount_heard_us_)) return Wait("the mount (MOUNT_STATE)");
  if (mount_state_->command_id != command_.command_id) {
    if (ElapsedSince(command_.command_id) > params_.silence_s) return Wait("the mount to take commands");
    if (ElapsedSince(command_sent_us_) > params_.resend_s) SendCommand();
    return;
  }
  switch (mount_state_->result) {
    case messaging::MountState::Result::kArrived:
      refusals_ = 0;
      total_move_s_ += 1e-6 * static_cast<double>(mount_state_->utime - command_.command_id);
      look_ = Look();
      look_.arrived_us = mount_state_->utime;
      look_.since_us = now_us();
      phase_ = Phase::kLooking;
      status_.state = "looking";
      return;
    case messaging::MountState::Result::kRefused:
      NoteError("the mount refused the way: " + mount_state_->refusal);
      if (++refusals_ >= params_.max_refusals) return EndAttempt(false);
      return Wait("another way");
    case messaging::MountState::Result::kStopped:
      return Wait("another way: the mount was stopped");
    default:
      return;
  }
}

void PlannerNode::LookAround() {
  const bool learned = views() > views_at_departure_;
  const bool seen_enough = learned ? look_.frames >= 1 : look_.frames >= params_.look_frames && !look_.view_coming;
  if (seen_enough) return EndAttempt(true);
  if (ElapsedSince(look_.since_us) < params_.look_s) return;
  if (look_.frames > 0) return EndAttempt(true);
  Wait("the learner (LEARNER_TRACK)");  // It said nothing: that is no failure of the view.
}

void PlannerNode::EndAttempt(bool reached) {
  exploration::Attempt attempt = reached ? look_.seen : exploration::Attempt();
  attempt.viewpoint = decision_->candidates[static_cast<std::size_t>(decision_->chosen)].view.viewpoint;
  attempt.view_added = views() > views_at_departure_;
  attempt.detected |= reached && attempt.view_added;
  attempt.t_plan_s = plan_s_;
  attempt.looked = reached;
  attempt.t_learn_s = reached ? ElapsedSince(look_.since_us) : 0.0;
  strategy_->Report(attempt);
  total_learn_s_ += attempt.t_learn_s;
  refusals_ = 0;
  ++status_.attempts;
  if (!attempt.view_added) ++status_.failed_attempts;
  status_.views = views();
  const std::string outcome = attempt.view_added ? "view added" : reached ? look_.note : "the mount refuses to go there";
  std::fprintf(stderr, "%6.1f s  attempt %d: %s; %d views, completeness %.3f before it\n", ElapsedSince(first_decision_us_),
               status_.attempts, outcome.c_str(), views(), status_.completeness);
  Wait("the next decision");
}

void PlannerNode::Finish(const std::string& reason) {
  if (phase_ == Phase::kMoving)
    bus_.Publish(messaging::kMountCommand, messaging::ToMessage(motion::Trajectory(), now_us(), now_us()));
  phase_ = Phase::kDone;
  status_.state = "done";
  status_.stop_reason = reason;
  status_.views = views();
  std::fprintf(stderr, "%6.1f s  stopped: %s%s; %d views, completeness %.3f\n",
               first_decision_us_ > 0 ? ElapsedSince(first_decision_us_) : 0.0, reason.c_str(),
               status_.decision == 0 && !waiting_for_.empty() ? (" (waited for " + waiting_for_ + ")").c_str() : "", views(),
               status_.completeness);
  Publish();
  WriteSummary();
}

void PlannerNode::Publish() {
  next_publish_us_ = now_us() + static_cast<std::int64_t>(params_.publish_period_s * 1e6);
  status_.utime = now_us();
  status_.object = object_;
  if (phase_ != Phase::kDone) status_.elapsed_s = first_decision_us_ > 0 ? ElapsedSince(first_decision_us_) : 0.0;
  bus_.Publish(messaging::kPlannerPlan, messaging::ToMessage(status_, decision_ ? &*decision_ : nullptr));
  if (belief_.reachable.empty()) return;
  messaging::Reach reach;
  reach.utime = now_us();
  reach.object = object_;
  reach.viewpoints = belief_.reachable;
  bus_.Publish(messaging::kPlannerReach, messaging::ToMessage(reach));
}

void PlannerNode::WriteSummary() const {
  if (params_.summary.empty()) return;
  nlohmann::json json;
  json["object"] = object_;
  json["strategy"] = params_.strategy;
  json["views"] = views();
  json["attempts"] = status_.attempts;
  json["failed_attempts"] = status_.failed_attempts;
  json["completeness"] = status_.completeness;
  json["time_s"] = {{"plan", total_plan_s_}, {"move", total_move_s_}, {"learn", total_learn_s_}, {"total", status_.elapsed_s}};
  json["measured_views"] = measured_views_;
  json["stop_reason"] = status_.stop_reason;
  if (status_.decision == 0 && !waiting_for_.empty()) json["waited_for"] = waiting_for_;
  json["store"] = store_;
  // Readers see the whole file or none.
  const std::string unfinished = params_.summary + ".part";
  std::ofstream file(unfinished);
  file << json.dump(2) << '\n';
  file.close();
  if (!file || std::rename(unfinished.c_str(), params_.summary.c_str()) != 0) {
    throw std::runtime_error(params_.summary + ": cannot be written; does the folder exist, is there space?");
  }
}

}  // namespace vantage::planner
