// The planner process and the library's loop, which `vantage explore` runs, choose the same views: mount, learner and assessor are
// played by the test, the same way for both.
#include <gtest/gtest.h>

#include "geometry/view_sphere.h"
#include "messaging/channels.h"
#include "planner/node.h"

namespace vantage::planner {
namespace {

constexpr char kObject[] = "box";
constexpr double kLearn_s = 0.3;

// Detection falls evenly to nothing at 45 degrees.
measures::PredictedSuccess Falling() {
  using measures::PredictedSuccess;
  std::vector<double> trials(PredictedSuccess::kRotationCells * PredictedSuccess::kScaleCells, 1000.0), successes(trials);
  for (std::size_t i = 0; i < trials.size(); ++i) {
    const double degrees = 5.0 * (static_cast<double>(i / PredictedSuccess::kScaleCells) + 0.5);
    successes[i] *= std::max(0.0, 1.0 - degrees / 45.0);
  }
  return PredictedSuccess::FromCounts(trials, successes, measures::Source::kOwn);
}

// The learner of this world: it adds a view where the object is likely to be found, but never from behind.
bool Learns(const measures::Viewpoint& viewpoint, const std::vector<measures::Viewpoint>& views) {
  return viewpoint.direction.x() > -0.6 && measures::DetectionProbability(views, viewpoint, Falling()) > 0.3;
}

// ...and on one side it sees it well where it adds none.
learning::LearnerResult Sees(const measures::Viewpoint& viewpoint, bool added) {
  learning::LearnerResult seen;
  seen.state = learning::State::kTracking;
  seen.probability = added || viewpoint.direction.x() < -0.6 ? 0.9 : 0.2;
  seen.confidence.value = viewpoint.direction.y() > 0.0 ? 0.7 : 0.3;
  return seen;
}

geometry::Rigid ObjectPose() {
  geometry::Rigid T_world_object = geometry::Rigid::Identity();
  T_world_object.translation() = Eigen::Vector3d(0.0, 0.0, 0.1);
  return T_world_object;
}

geometry::Rigid Start() { return geometry::LookAt({0.5, 0.05, 0.4}, {0, 0, 0.1}, Eigen::Vector3d::UnitZ()); }

PlannerNodeParams Params(const std::string& mount) {
  PlannerNodeParams params;
  params.planner.max_attempts = 12;
  params.planner.time_budget_s = 1e4;
  params.time_limit_s = 1e4;
  params.candidates.distances_m = {0.5};
  params.mount.type = mount;
  params.mount.arm.urdf = std::string(VANTAGE_SOURCE_DIR) + "/config/robots/arm.urdf";
  params.look_frames = 1;
  params.settle_s = 0.0;
  return params;
}

class SameViews : public ::testing::TestWithParam<const char*> {
 protected:
  SameViews() : bus_("memq://", [this] { return now_us_; }), params_(Params(GetParam())), maker_(params_.mount) {
    bus_.Subscribe<mount_command_t>(messaging::kMountCommand, [this](const mount_command_t& message) {
      if (message.command_id == state_.command_id) return;
      command_ = *messaging::FromMessage(message);
      state_.command_id = message.command_id;
    });
    const motion::Stance stance = maker_.Make({})->StanceAt(Start()).value();
    state_.T_world_mount = stance.T_world_camera;
    state_.joints_rad = stance.joints_rad;
    scene_.object = kObject;
    segmentation::Plane table;
    table.normal = Eigen::Vector3d::UnitZ();
    table.offset_m = 0.0;
    scene_.plane = table;
    motion::HullObstacle hull{"beside", {}};
    for (const Eigen::Vector3d& direction : geometry::EvenDirections(200)) {
      hull.points_in_world.emplace_back(Eigen::Vector3d(0.1, 0.35, 0.15) + 0.12 * direction);
    }
    scene_.hulls.push_back(hull);
    views_.push_back(exploration::ViewpointOf(stance.T_world_camera, ObjectPose()));
  }

  void Tell(bool added) {
    state_.utime = scene_.utime = now_us_;
    bus_.Publish(messaging::kMountState, messaging::ToMessage(state_));
    bus_.Publish(messaging::kLearnerScene, messaging::ToMessage(scene_));
    if (added) {
      messaging::AddedView view;
      view.utime = now_us_;
      view.object = kObject;
      view.views = static_cast<int>(views_.size());
      view.viewpoint = views_.back();
      bus_.Publish(messaging::kLearnerView, messaging::ToMessage(view));
    }
    messaging::ObjectMeasures measures;
    measures.object = kObject;
    measures.views = static_cast<int>(views_.size());
    measures.measures.predicted = Falling();
    bus_.Publish(messaging::kAssessorMeasures, messaging::ToMessage(measures));
    messaging::Track track;
    track.utime = now_us_;
    track.object = kObject;
    track.T_world_object = ObjectPose();
    track.result = sees_;
    track.views = static_cast<int>(views_.size());
    bus_.Publish(messaging::kLearnerTrack, messaging::ToMessage(track));
  }

  void Step(PlannerNode& node, double seconds) {
    now_us_ += static_cast<std::int64_t>(1e6 * seconds);
    bus_.Drain();
    node.RunStep();
    bus_.Drain();
  }

  std::int64_t now_us_ = 1000000;
  messaging::Bus bus_;
  PlannerNodeParams params_;
  motion::MountMaker maker_;
  messaging::MountState state_;
  messaging::Scene scene_;
  std::vector<measures::Viewpoint> views_;
  learning::LearnerResult sees_;  // Just now.
  std::optional<motion::Trajectory> command_;
};

TEST_P(SameViews, AsTheLoopOfTheLibrary) {
  PlannerNode node(bus_, params_);
  Tell(true);
  // Where the process goes.
  std::vector<Eigen::Vector3d> process_went;
  for (int i = 0; i < 400 && !node.done(); ++i) {
    command_.reset();
    Tell(false);
    Step(node, 0.05);
    if (!command_ || command_->waypoints.empty()) continue;
    const motion::Waypoint& end = command_->waypoints.back();
    process_went.push_back(end.T_world_mount.translation());
    state_.T_world_mount = end.T_world_mount;
    state_.joints_rad = end.joints_rad;
    state_.result = messaging::MountState::Result::kArrived;
    state_.utime = now_us_;
    bus_.Publish(messaging::kMountState, messaging::ToMessage(state_));
    Step(node, 0.0);
    now_us_ += static_cast<std::int64_t>(1e6 * kLearn_s);
    const measures::Viewpoint viewpoint = exploration::ViewpointOf(end.T_world_mount, ObjectPose());
    const bool added = Learns(viewpoint, views_);
    if (added) views_.push_back(viewpoint);
    sees_ = Sees(viewpoint, added);
    Tell(added);
    Step(node, 0.0);
  }
  ASSERT_TRUE(node.done()) << node.status().state;

  // Where the loop of the library goes, told the same.
  const auto strategy = exploration::MakeStrategy(params_.strategy, params_.planner, params_.seed);
  const auto candidates = exploration::SampleCandidates(ObjectPose(), params_.candidates);
  const auto mount = maker_.Make(node.obstacles());
  exploration::Belief belief;
  belief.predicted = Falling();
  motion::Stance stance = maker_.Make({})->StanceAt(Start()).value();
  belief.views.push_back(exploration::ViewpointOf(stance.T_world_camera, ObjectPose()));
  for (const auto& candidate : candidates) {
    if (mount->WhyUnreachable(candidate.T_world_camera).empty()) belief.reachable.push_back({candidate.viewpoint, 1.0});
  }
  std::vector<Eigen::Vector3d> library_went;
  exploration::StopReason stop = exploration::StopReason::kNone;
  while (stop == exploration::StopReason::kNone) {
    const exploration::Decision decision = strategy->Decide(belief, candidates, stance, *mount, 0.0);
    stop = decision.stop;
    if (decision.chosen < 0) break;
    const auto& chosen = decision.candidates[static_cast<std::size_t>(decision.chosen)];
    const motion::Waypoint& end = chosen.path->waypoints.back();
    library_went.push_back(end.T_world_mount.translation());
    stance = {end.T_world_mount, end.joints_rad};
    const measures::Viewpoint viewpoint = exploration::ViewpointOf(end.T_world_mount, ObjectPose());
    const bool added = Learns(viewpoint, belief.views);
    if (added) belief.views.push_back(viewpoint);
    exploration::Attempt attempt{chosen.view.viewpoint, false, added, false, 0.0, kLearn_s};
    session::NoteFrame(Sees(viewpoint, added), params_.learner, attempt);
    strategy->Report(attempt);
  }
  EXPECT_EQ(node.status().stop_reason, exploration::ToString(stop));
  ASSERT_EQ(process_went.size(), library_went.size());
  EXPECT_GE(library_went.size(), 5u);
  for (std::size_t i = 0; i < library_went.size(); ++i)
    EXPECT_LT((process_went[i] - library_went[i]).norm(), 0.02) << "decision " << i;
}

INSTANTIATE_TEST_SUITE_P(Mounts, SameViews, ::testing::Values("free", "arm"),
                         [](const auto& one) { return std::string(one.param); });

}  // namespace
}  // namespace vantage::planner
