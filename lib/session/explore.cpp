#include "session/explore.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "assessment/background.h"
#include "geometry/rigid.h"
#include "session/attempt.h"
#include "session/scene_map.h"

namespace vantage::session {
namespace {

constexpr double kAuditStep_s = 0.01;
constexpr double kMinShareInView = 0.7;  // A recorded pose is a candidate where this share of the model would be in the image.

// A frame is an attempt, seconds after the last one: a refinement begun then is done by now.
learning::LearnerParams InLockStep(learning::LearnerParams params) {
  params.refine_delay_frames = std::min(params.refine_delay_frames, 1);
  return params;
}

// One run: the robot's state and what it has learned.
class Run {
 public:
  Run(const simulation::World& world, const ExploreStart& start, const ExploreParams& params, const Judge* judge,
      model::Store* store, const std::function<void(const ExploreStep&)>& progress)
      : world_(world),
        start_(start),
        params_(params),
        judge_(judge),
        store_(store),
        progress_(progress),
        learner_(InLockStep(params.learner), start.object_name),
        mounts_(params.mount),
        strategy_(exploration::MakeStrategy(params.strategy, params.planner, params.seed, params.outcomes)) {}

  ExploreResult Go() {
    result_.strategy = params_.strategy;
    result_.seed = params_.seed;
    Begin();
    while (Step()) {
    }
    Finish();
    return result_;
  }

 private:
  void Begin() {
    const rgbd::Frame frame = world_.Look(start_.T_world_camera, params_.seed);
    stance_ = mounts_.Make({})->StanceAt(start_.T_world_camera).value_or(motion::Stance(*frame.T_world_camera));
    const learning::LearnerResult first = learner_.Process(frame, start_.target);
    if (!first.view_added) throw std::runtime_error("no object was found from the start pose: " + first.note);
    NoteScene(frame, true);
    result_.time.learn_s += params_.planner.t_learn_s;
    LearnedView(frame);
    Tell("first view", nullptr);
  }

  // One decision and the attempt it leads to; false when the strategy stops.
  bool Step() {
    const exploration::Belief belief = BeliefNow();
    const auto mount = mounts_.Make(obstacles_);
    const exploration::Decision decision = strategy_->Decide(belief, candidates_, stance_, *mount, result_.time.total_s());
    if (decision.chosen < 0) {
      result_.stop_reason = exploration::ToString(decision.stop);
      Tell("stop: " + result_.stop_reason, &decision);
      return false;
    }
    const exploration::Candidate& chosen = decision.candidates[decision.chosen];
    result_.time.plan_s += params_.planner.t_plan_s;
    result_.time.move_s += chosen.t_move_s;
    result_.time.learn_s += params_.planner.t_learn_s;
    Attempt(chosen, decision);
    return true;
  }

  void Attempt(const exploration::Candidate& chosen, const exploration::Decision& decision) {
    ++result_.attempts;
    Audit(*chosen.path);
    const motion::Waypoint& end = chosen.path->waypoints.back();  // An arm may have turned the camera about its axis.
    const rgbd::Frame frame = world_.Look(end.T_world_mount, params_.seed + 1000u * result_.attempts);
    stance_ = {*frame.T_world_camera, end.joints_rad};
    const learning::LearnerResult learned = learner_.Process(frame);
    NoteScene(frame, learned.view_added);
    exploration::Attempt attempt;
    attempt.viewpoint = chosen.view.viewpoint;
    NoteFrame(learned, {params_.learner.min_track_probability, params_.learner.new_view_confidence}, attempt);
    attempt.view_added = learned.view_added;
    attempt.t_plan_s = params_.planner.t_plan_s;
    attempt.t_learn_s = params_.planner.t_learn_s;
    Log(chosen, learned, attempt);
    strategy_->Report(attempt);
    if (learned.view_added) {
      LearnedView(frame);
    } else {
      if (learned.refined && store_) store_->Update(*learner_.object());
      ++result_.failed_attempts;
    }
    Tell(learned.view_added ? "view added" : learned.note, &decision);
  }

  void Log(const exploration::Candidate& chosen, const learning::LearnerResult& learned, const exploration::Attempt& attempt) {
    const exploration::Belief belief = BeliefNow();
    const auto before = static_cast<std::ptrdiff_t>(belief.views.size()) - (learned.view_added ? 1 : 0);
    const std::vector<measures::Viewpoint> views(belief.views.begin(), belief.views.begin() + before);
    ExploreAttempt entry;
    entry.time_s = result_.time.total_s();
    entry.predicted = measures::DetectionProbability(views, chosen.view.viewpoint, belief.predicted, params_.planner.rule);
    entry.detect_probability = chosen.detect_probability;
    entry.gain = chosen.gain;
    entry.nearest_view_rad = M_PI;
    for (const measures::Viewpoint& view : views) {
      entry.nearest_view_rad =
          std::min(entry.nearest_view_rad, geometry::AngleBetween(view.direction, chosen.view.viewpoint.direction));
    }
    entry.move_s = chosen.t_move_s;
    entry.detected = attempt.detected;
    entry.view_added = learned.view_added;
    entry.note = learned.note;
    result_.log.push_back(entry);
  }

  void Audit(const motion::Trajectory& path) {
    motion::Obstacles all = obstacles_;
    for (const simulation::TrueObject& object : world_.Truth()) {
      if (object.points.cols() == 0) continue;
      motion::HullObstacle hull{object.name, {}};
      for (Eigen::Index i = 0; i < object.points.cols(); ++i) {
        hull.points_in_world.push_back(object.T_world_object * Eigen::Vector3d(object.points.col(i)));
      }
      all.hulls.push_back(std::move(hull));
    }
    const motion::PathAudit audit = motion::AuditPath(path, mounts_.Body(), all, kAuditStep_s);
    ++result_.audit.paths;
    result_.audit.touching += audit.touches();
    if (audit.clearance_m >= result_.audit.clearance_m) return;
    result_.audit.clearance_m = audit.clearance_m;
    result_.audit.obstacle = audit.obstacle;
  }

  // After every new view: durable, assessed, judged.
  void LearnedView(const rgbd::Frame& frame) {
    const auto object = learner_.object();
    const int newest = static_cast<int>(object->views.size()) - 1;
    if (store_) store_->Update(*object);
    AddBackground(frame);
    assessment::TrialParams trials = params_.trials;
    trials.seed += params_.seed;
    const auto fresh = assessment::RunTrials(*object, newest, &backgrounds_, params_.learner.recogniser, trials);
    trials_.insert(trials_.end(), fresh.begin(), fresh.end());
    learner_.SetMeasures(assessment::FitMeasures(trials_, params_.learner.recogniser, params_.trials.observed_fit));
    ListCandidates();
    result_.completeness = CompletenessNow();
    if (store_) store_->SaveMeasures(object->name, learner_.object()->measures, result_.completeness);
    result_.completeness_over_time.emplace_back(result_.time.total_s(), result_.completeness);
    if (judge_ && params_.judge_over_time) {
      result_.true_rate_over_time.emplace_back(result_.time.total_s(), TrueRateSince(object->views.back().viewpoint().direction));
    }
  }

  void AddBackground(const rgbd::Frame& frame) {
    if (static_cast<int>(backgrounds_.size()) >= params_.max_backgrounds) return;
    cv::Mat objects = cv::Mat::zeros(frame.color.size(), CV_8UC1);
    for (const segmentation::Cluster& cluster : learner_.clusters()) objects |= cluster.mask;
    backgrounds_.push_back({assessment::MaskedBackground(frame.color, objects), nullptr});
  }

  // All that stands on the table, recognised or not, in every frame. The learner looks for it only where it learns.
  void NoteScene(const rgbd::Frame& frame, bool learned) {
    if (learned) {
      scene_.Add(frame, *learner_.plane(), learner_.clusters());
    } else if (const auto plane = segmentation::FitPlane(frame, params_.learner.plane)) {
      scene_.Add(frame, *plane, segmentation::FindClusters(frame, *plane, params_.learner.clusters));
    }
    obstacles_ = world_.Furniture();
    obstacles_.hulls = scene_.hulls();
  }

  // Where the camera could go, given where the object stands, and where it can from what is known by now.
  void ListCandidates() {
    if (candidates_.empty()) MakeCandidates();
    reachable_.clear();
    const auto mount = mounts_.Make(obstacles_);
    for (const exploration::CandidateView& candidate : candidates_) {
      if (mount->WhyUnreachable(candidate.T_world_camera).empty()) reachable_.push_back({candidate.viewpoint, 1.0});
    }
  }

  void MakeCandidates() {
    const geometry::Rigid T_world_object = *learner_.T_world_object();
    const std::vector<geometry::Rigid> recorded = world_.Viewpoints();
    if (recorded.empty()) {
      candidates_ = exploration::SampleCandidates(T_world_object, params_.candidates);
    }
    const Eigen::Matrix3Xd points = learner_.object()->PointMatrix();
    for (size_t i = 0; i < recorded.size(); ++i) {
      if (ShareInImage(points, recorded[i].inverse() * T_world_object, world_.Camera()) < kMinShareInView) continue;
      candidates_.push_back({static_cast<int>(i), recorded[i], exploration::ViewpointOf(recorded[i], T_world_object)});
    }
  }

  exploration::Belief BeliefNow() const {
    const auto object = learner_.object();
    return {object->viewpoints(), object->measures.predicted, reachable_};
  }

  double CompletenessNow() const {
    const exploration::Belief belief = BeliefNow();
    return measures::Completeness(belief.views, belief.reachable, belief.predicted, params_.planner.rule);
  }

  geometry::Rigid T_mesh_object() const { return start_.T_world_mesh.inverse() * *learner_.T_world_object(); }

  // Now that a view was learned from there.
  double TrueRateSince(const Eigen::Vector3d& direction) {
    const int wanted = params_.judge_views_over_time;
    const auto views = static_cast<std::size_t>(wanted > 0 ? std::min(wanted, judge_->size()) : judge_->size());
    outcomes_.resize(views, 0);
    const auto near = [&](double degrees) { return judge_->Near(direction, T_mesh_object(), degrees * M_PI / 180.0); };
    const std::vector<char> again = near(params_.judge_within_deg);
    std::vector<char> asked = near(params_.judge_reach_deg);
    for (std::size_t i = 0; i < asked.size(); ++i) {
      asked[i] = static_cast<char>(i < views && (outcomes_[i] == 0 ? asked[i] : again[i]) != 0);
    }
    const std::vector<char> now = judge_->Outcomes(learner_.object(), T_mesh_object(), asked);
    for (std::size_t i = 0; i < views; ++i) {
      if (asked[i] != 0) outcomes_[i] = now[i];
    }
    return std::accumulate(outcomes_.begin(), outcomes_.end(), 0.0) / std::max(1.0, static_cast<double>(views));
  }

  void Finish() {
    if (learner_.FinishRefinement() && store_) store_->Update(*learner_.object());
    result_.object = learner_.object();
    result_.views = static_cast<int>(result_.object->views.size());
    result_.completeness = CompletenessNow();
    if (judge_) result_.true_detection_rate = judge_->TrueDetectionRate(result_.object, T_mesh_object());
  }

  void Tell(const std::string& note, const exploration::Decision* decision) const {
    if (!progress_) return;
    progress_({result_.time.total_s(), result_.attempts, static_cast<int>(learner_.object()->views.size()), result_.completeness,
               note, decision});
  }

  const simulation::World& world_;
  const ExploreStart& start_;
  const ExploreParams& params_;
  const Judge* judge_;
  model::Store* store_;
  const std::function<void(const ExploreStep&)>& progress_;

  learning::Learner learner_;
  motion::MountMaker mounts_;
  std::unique_ptr<exploration::Strategy> strategy_;
  motion::Stance stance_;  // Now.
  SceneMap scene_;
  motion::Obstacles obstacles_;
  std::vector<assessment::Background> backgrounds_;
  std::vector<assessment::Trial> trials_;
  std::vector<exploration::CandidateView> candidates_;
  std::vector<measures::WeightedViewpoint> reachable_;
  std::vector<char> outcomes_;  // Of the judging views over time, when they were judged last.
  ExploreResult result_;
};

}  // namespace

void ExploreParams::Check() const {
  learner.Check();
  planner.Check();
  candidates.Check();
  mount.Check();
  trials.Check();
  const auto& names = exploration::StrategyNames();
  if (std::find(names.begin(), names.end(), strategy) == names.end()) {
    throw std::invalid_argument("explore: strategy is unknown: \"" + strategy + "\"");
  }
  if (!(judge_within_deg > 0.0 && judge_within_deg <= 180.0)) {
    throw std::invalid_argument("explore: judge_within_deg must be in (0, 180]");
  }
  if (!(judge_reach_deg >= judge_within_deg && judge_reach_deg <= 180.0)) {
    throw std::invalid_argument("explore: judge_reach_deg must be in [judge_within_deg, 180]");
  }
  if (judge_views_over_time < 0) throw std::invalid_argument("explore: judge_views_over_time must be >= 0");
  if (max_backgrounds < 0) throw std::invalid_argument("explore: max_backgrounds must be >= 0");
}

ExploreResult Explore(const simulation::World& world, const ExploreStart& start, const ExploreParams& params, const Judge* judge,
                      model::Store* store, const std::function<void(const ExploreStep&)>& progress) {
  params.Check();
  return Run(world, start, params, judge, store, progress).Go();
}

}  // namespace vantage::session
