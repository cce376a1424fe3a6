// All processes in one program over memq://: the loop closes.
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <vantage/answer_t.hpp>
#include <vantage/query_t.hpp>
#include <vantage/status_t.hpp>

#include "assessor/node.h"
#include "learner/node.h"
#include "messaging/channels.h"
#include "messaging/geometry_messages.h"
#include "messaging/run_loop.h"
#include "mount/node.h"
#include "planner/node.h"
#include "recogniser/node.h"
#include "sensor/node.h"
#include "simulation/simulated_world.h"
#include "support/folder.h"

namespace vantage {
namespace {

motion::SpeedLimits Quick() {
  motion::SpeedLimits limits;
  limits.max_speed_m_s = 1.0;
  limits.max_acceleration_m_s2 = 2.0;
  limits.max_turn_rate_rad_s = 3.0;
  limits.max_turn_acceleration_rad_s2 = 6.0;
  return limits;
}

TEST(Loop, ExploresAWorldAndStopsForAStatedReason) {
  const testing::TemporaryFolder folder;
  const auto world_file = std::string(VANTAGE_SOURCE_DIR) + "/config/worlds/table.yaml";
  const auto world_params = simulation::LoadWorldParams(world_file);
  const auto world = std::make_shared<simulation::SimulatedWorld>(world_params);
  const auto store = folder / "models.db";
  messaging::Bus bus("memq://");

  mount::MountParams mount_params;
  mount_params.start_eye_m = world_params.start_eye_m;
  mount_params.start_target_m = world_params.start_target_m;
  mount_params.limits = Quick();
  mount::MountNode mount(bus, mount_params);
  sensor::SensorNode sensor(bus, sensor::MakeWorldSource(world, 0), {});
  learner::LearnerNodeParams learner_params;
  learner_params.store = store;
  learner_params.object = "box";
  learner::LearnerNode learner(bus, learner_params);
  recogniser::RecogniserNodeParams recogniser_params;
  recogniser_params.store = store;
  recogniser::RecogniserNode recogniser(bus, recogniser_params);
  assessor::AssessorNodeParams assessor_params;
  assessor_params.store = store;
  assessor_params.niceness = 0;
  assessor_params.trials.trials_per_view = 4;
  assessor_params.trials.negatives_per_view = 1;
  assessor::AssessorNode assessor(bus, assessor_params);
  planner::PlannerNodeParams planner_params;
  planner_params.planner.max_attempts = 2;
  planner_params.mount.free.limits = Quick();
  planner_params.summary = folder / "summary.json";
  planner::PlannerNode planner(bus, planner_params);

  int detections = 0;
  bus.Subscribe<detections_t>(messaging::kRecogniserDetections, [&](const detections_t& m) { detections += m.count; });
  std::optional<messaging::ObjectMeasures> measures;
  bus.Subscribe<measures_t>(messaging::kAssessorMeasures, [&](const measures_t& m) { measures = *messaging::FromMessage(m); });
  std::optional<answer_t> answer;
  bus.Subscribe<answer_t>(messaging::kAssessorAnswer, [&](const answer_t& m) { answer = m; });

  const std::int64_t deadline_us = bus.now_us() + 120 * 1000000LL;
  messaging::RunParams run;
  run.until = [&] {
    return bus.now_us() > deadline_us || (planner.done() && detections > 0 && measures && recogniser.objects() == 1);
  };
  const std::vector<messaging::Node*> nodes = {&mount, &sensor, &learner, &recogniser, &assessor, &planner};
  messaging::RunNodes(bus, nodes, nullptr, run);

  ASSERT_TRUE(planner.done()) << "state " << planner.status().state;
  EXPECT_EQ(planner.status().stop_reason, "max_attempts");
  EXPECT_EQ(planner.status().attempts, 2);
  EXPECT_GE(planner.status().views, 2);
  EXPECT_GT(detections, 0);
  ASSERT_TRUE(measures);
  EXPECT_EQ(measures->object, "box");
  EXPECT_EQ(measures->measures.predicted.source(), measures::Source::kOwn);
  for (const auto* node : nodes) EXPECT_EQ(node->bad(), 0) << node->process() << ": " << node->last_error();

  const auto summary = nlohmann::json::parse(std::ifstream(folder / "summary.json"));
  EXPECT_EQ(summary.at("stop_reason"), "max_attempts");
  EXPECT_EQ(summary.at("views"), planner.status().views);
  EXPECT_FALSE(planner.obstacles().hulls.empty());

  // The object stands where the world says it does.
  ASSERT_TRUE(learner.learner().T_world_object());
  const Eigen::Vector3d foot = world_params.objects[0].position_m;
  EXPECT_LT((learner.learner().T_world_object()->translation() - foot).head<2>().norm(), 0.08);

  // What is in the store is what was learned, measures included.
  const auto stored = model::Store(store, model::Store::Mode::kRead).Load("box");
  ASSERT_TRUE(stored);
  ASSERT_TRUE(learner.learner().object());
  EXPECT_EQ(stored->views.size(), learner.learner().object()->views.size());
  EXPECT_GE(static_cast<int>(stored->views.size()), planner.status().views);  // The learner goes on after the planner stopped.

  // The assessor is asked by another: from a learned view the object is likely detected, from the far side less so.
  const auto ask = [&](const geometry::Rigid& T_object_camera) {
    query_t query;
    query.utime = bus.now_us();
    query.query_id = 5;
    query.object = "box";
    query.frame = query_t::FRAME_OBJECT;
    query.T_frame_camera = messaging::ToMessage(T_object_camera);
    answer.reset();
    bus.Publish(messaging::kAssessorQuery, query);
    while (!answer && bus.Handle(100) == messaging::Bus::Handled::kMessage) {
    }
    EXPECT_TRUE(answer && answer->known) << (answer ? answer->error : "no answer");
    return answer ? answer->probability : -1.0;
  };
  const geometry::Rigid T_object_camera = stored->views[0].T_camera_object.inverse();
  geometry::Rigid far_side = T_object_camera;
  far_side.translation().head<2>() *= -1.0;
  EXPECT_GT(ask(T_object_camera), ask(far_side));
}

}  // namespace
}  // namespace vantage
