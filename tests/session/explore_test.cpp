// The closed loop in lock step, in the shipped simulated world with few trials.
#include "session/explore.h"

#include <gtest/gtest.h>

#include "simulation/simulated_world.h"
#include "support/temp_folder.h"

namespace vantage::session {
namespace {

ExploreParams QuickParams() {
  ExploreParams params;
  params.trials.trials_per_view = 8;
  params.trials.negatives_per_view = 2;
  params.planner.max_attempts = 3;
  params.seed = 4;
  return params;
}

class Table : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    const auto file = std::filesystem::path(VANTAGE_SOURCE_DIR) / "config" / "worlds" / "table.yaml";
    world_ = std::make_unique<simulation::SimulatedWorld>(simulation::LoadWorldParams(file));
  }
  static void TearDownTestSuite() { world_.reset(); }

  static ExploreStart Start() {
    const simulation::TrueObject object = world_->Truth().front();
    ExploreStart start;
    start.T_world_camera = world_->StartPose();
    start.object_name = object.name;
    start.T_world_mesh = object.T_world_object;
    const Eigen::Vector3d centre = object.T_world_object * Eigen::Vector3d(object.points.rowwise().mean());
    start.target.pixel = world_->Camera().Project(start.T_world_camera.inverse() * centre);
    return start;
  }

  static std::unique_ptr<simulation::SimulatedWorld> world_;
};
std::unique_ptr<simulation::SimulatedWorld> Table::world_;

TEST_F(Table, LearnsViewsKeepsThemAndEndsByItself) {
  const testing::TempFolder folder;
  model::Store store(folder.path() / "models.db", model::Store::Mode::kWrite);
  const ExploreParams params = QuickParams();
  const simulation::TrueObject object = world_->Truth().front();
  Judge judge(params.learner.recogniser, object.points);
  const geometry::Rigid T_world_camera = world_->StartPose();
  ASSERT_TRUE(judge.Add(world_->Look(T_world_camera, 99), T_world_camera.inverse() * object.T_world_object));

  std::vector<std::string> notes;
  const ExploreResult result =
      Explore(*world_, Start(), params, &judge, &store, [&](const ExploreStep& step) { notes.push_back(step.note); });
  EXPECT_EQ(result.stop_reason, "max_attempts");
  EXPECT_EQ(result.attempts, 3);
  EXPECT_GE(result.views, 2);
  EXPECT_EQ(result.views, 1 + result.attempts - result.failed_attempts);
  EXPECT_EQ(result.completeness_over_time.size(), static_cast<std::size_t>(result.views));
  EXPECT_GT(result.completeness, 0.0);
  EXPECT_LE(result.completeness, 1.0);
  EXPECT_GT(result.time.move_s, 0.0);
  EXPECT_EQ(result.true_detection_rate, 1.0);  // Judged by the very view it learned first.
  EXPECT_EQ(notes.front(), "first view");

  const auto stored = store.Load(Start().object_name);
  ASSERT_TRUE(stored.has_value());
  EXPECT_EQ(static_cast<int>(stored->views.size()), result.views);
  EXPECT_EQ(stored->measures.observed.source(), measures::Source::kOwn);
}

TEST_F(Table, JudgesOnTheWayByTheFirstViewsAndAtTheEndByAll) {
  ExploreParams params = QuickParams();
  params.planner.max_attempts = 1;
  params.judge_views_over_time = 1;
  const simulation::TrueObject object = world_->Truth().front();
  Judge judge(params.learner.recogniser, object.points);
  const geometry::Rigid T_world_camera = world_->StartPose();
  // The second is not what it is said to be: there nothing can be detected.
  for (const double aside_m : {0.0, 0.5}) {
    geometry::Rigid T_camera_mesh = T_world_camera.inverse() * object.T_world_object;
    if (aside_m > 0.0) T_camera_mesh.translation().z() += aside_m;
    ASSERT_TRUE(judge.Add(world_->Look(T_world_camera, 99), T_camera_mesh));
  }
  const ExploreResult result = Explore(*world_, Start(), params, &judge, nullptr);
  ASSERT_FALSE(result.true_rate_over_time.empty());
  for (const auto& [time_s, rate] : result.true_rate_over_time) EXPECT_EQ(rate, 1.0) << time_s;
  EXPECT_EQ(result.true_detection_rate, 0.5);
}

TEST_F(Table, SameSeedSameRun) {
  ExploreParams params = QuickParams();
  params.planner.max_attempts = 1;
  const ExploreResult a = Explore(*world_, Start(), params, nullptr, nullptr);
  const ExploreResult b = Explore(*world_, Start(), params, nullptr, nullptr);
  EXPECT_EQ(a.completeness_over_time, b.completeness_over_time);
  EXPECT_EQ(a.time.total_s(), b.time.total_s());
  EXPECT_EQ(a.object->points.size(), b.object->points.size());
}

TEST_F(Table, AnArmExploresAndTouchesNothing) {
  ExploreParams params = QuickParams();
  params.mount.type = "arm";
  params.mount.arm.urdf = std::string(VANTAGE_SOURCE_DIR) + "/config/robots/arm.urdf";
  params.candidates.distances_m = {0.5};
  const ExploreResult result = Explore(*world_, Start(), params, nullptr, nullptr);
  EXPECT_EQ(result.attempts, 3);
  EXPECT_GE(result.views, 2);
  EXPECT_GT(result.time.move_s, 0.0);
  EXPECT_EQ(result.audit.paths, 3);
  EXPECT_EQ(result.audit.touching, 0) << result.audit.obstacle << " " << result.audit.clearance_m;
}

TEST_F(Table, SaysWhenNothingIsThereToLearn) {
  ExploreStart start = Start();
  start.T_world_camera = geometry::LookAt({0, 0, 1.0}, {3, 0, 1.0}, Eigen::Vector3d::UnitZ());  // At the wall.
  EXPECT_THROW(Explore(*world_, start, QuickParams(), nullptr, nullptr), std::runtime_error);
  ExploreParams params = QuickParams();
  params.strategy = "sideways";
  EXPECT_THROW(Explore(*world_, Start(), params, nullptr, nullptr), std::invalid_argument);
}

}  // namespace
}  // namespace vantage::session
