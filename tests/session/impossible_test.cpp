// Worlds in which nothing can be explored: the run ends soon, and says why.
#include <gtest/gtest.h>

#include <set>

#include "session/explore.h"
#include "simulation/simulated_world.h"

namespace vantage::session {
namespace {

// The shipped world, in which things can happen.
class StrangeWorld : public simulation::World {
 public:
  StrangeWorld()
      : world_(simulation::LoadWorldParams(std::filesystem::path(VANTAGE_SOURCE_DIR) / "config" / "worlds" / "table.yaml")) {}

  std::vector<motion::BoxObstacle> walls;
  int looks_until_removed = 1000;  // Then somebody takes the object away.

  rgbd::Frame Look(const geometry::Rigid& T_world_camera, std::uint32_t seed) const override {
    if (looks_++ >= looks_until_removed) world_.ShowObject(0, false);
    return world_.Look(T_world_camera, seed);
  }
  std::vector<geometry::Rigid> Viewpoints() const override { return {}; }
  geometry::Rigid StartPose() const override { return world_.StartPose(); }
  geometry::PinholeCamera Camera() const override { return world_.Camera(); }
  motion::Obstacles Furniture() const override {
    motion::Obstacles furniture = world_.Furniture();
    furniture.boxes.insert(furniture.boxes.end(), walls.begin(), walls.end());
    return furniture;
  }
  std::vector<simulation::TrueObject> Truth() const override { return world_.Truth(); }

 private:
  mutable simulation::SimulatedWorld world_;
  mutable int looks_ = 0;
};

motion::BoxObstacle Wall(const Eigen::Vector3d& centre, const Eigen::Vector3d& size) {
  motion::BoxObstacle wall;
  wall.name = "wall";
  wall.T_world_box.translation() = centre;
  wall.size_m = size;
  return wall;
}

// Four walls, floor and lid around a place.
void BoxIn(const Eigen::Vector3d& centre, double half_m, std::vector<motion::BoxObstacle>& walls) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      Eigen::Vector3d place = centre, size = Eigen::Vector3d::Constant(2.0 * half_m + 0.02);
      place[axis] += side * half_m;
      size[axis] = 0.01;
      walls.push_back(Wall(place, size));
    }
  }
}

ExploreParams Quick() {
  ExploreParams params;
  params.trials.trials_per_view = 8;
  params.trials.negatives_per_view = 2;
  params.candidates.directions = 60;
  return params;
}

void UseArm(ExploreParams& params) {
  params.mount.type = "arm";
  params.mount.arm.urdf = std::string(VANTAGE_SOURCE_DIR) + "/config/robots/arm.urdf";
  params.candidates.distances_m = {0.5};
}

// What the last decision said of its candidates.
struct Ended {
  ExploreResult result;
  std::set<std::string> refusals;
};

Ended ExploreIt(const StrangeWorld& world, const ExploreParams& params) {
  const simulation::TrueObject object = world.Truth().front();
  ExploreStart start;
  start.T_world_camera = world.StartPose();
  start.object_name = object.name;
  start.T_world_mesh = object.T_world_object;
  const Eigen::Vector3d centre = object.T_world_object * Eigen::Vector3d(object.points.rowwise().mean());
  start.target.pixel = world.Camera().Project(start.T_world_camera.inverse() * centre);
  Ended ended;
  ended.result = Explore(world, start, params, nullptr, nullptr, [&](const ExploreStep& step) {
    if (step.decision == nullptr) return;
    ended.refusals.clear();
    for (const auto& candidate : step.decision->candidates) ended.refusals.insert(candidate.refusal);
  });
  return ended;
}

TEST(Impossible, ObjectOutOfReachOfTheArm) {
  ExploreParams params = Quick();
  UseArm(params);
  params.mount.arm.base_position_m = {-3.0, 0.0, 1.5};
  const Ended ended = ExploreIt(StrangeWorld(), params);
  EXPECT_EQ(ended.result.stop_reason, "nothing_reachable");
  EXPECT_EQ(ended.result.attempts, 0);
  EXPECT_EQ(ended.refusals, std::set<std::string>{"out of reach"});
}

TEST(Impossible, ObjectOutsideTheWorkspaceOfTheFreeCamera) {
  ExploreParams params = Quick();
  params.mount.free.workspace_upper_m = {-1.0, 1.5, 2.0};
  const Ended ended = ExploreIt(StrangeWorld(), params);
  EXPECT_EQ(ended.result.stop_reason, "nothing_reachable");
  EXPECT_EQ(ended.refusals, std::set<std::string>{"out of the workspace"});
}

TEST(Impossible, ArmBoxedIn) {
  ExploreParams params = Quick();
  UseArm(params);
  StrangeWorld world;
  for (const double side : {-1.0, 1.0}) {  // A shaft around the arm's base, down to the table.
    world.walls.push_back(Wall({-0.25 + side * 0.2, 0.0, 0.8}, {0.02, 0.4, 1.5}));
    world.walls.push_back(Wall({-0.25, side * 0.2, 0.8}, {0.4, 0.02, 1.5}));
  }
  const Ended ended = ExploreIt(world, params);
  EXPECT_EQ(ended.result.stop_reason, "nothing_reachable");
  EXPECT_EQ(ended.result.attempts, 0);
}

TEST(Impossible, FreeCameraBoxedIn) {
  StrangeWorld world;
  BoxIn(world.StartPose().translation(), 0.12, world.walls);  // Of glass: it sees what it cannot go to.
  const Ended ended = ExploreIt(world, Quick());
  EXPECT_EQ(ended.result.stop_reason, "nothing_reachable");
  EXPECT_EQ(ended.result.attempts, 0);
  EXPECT_EQ(ended.refusals.count("no path found"), 1u);
}

TEST(Impossible, ObjectTakenAwayWhileExploring) {
  StrangeWorld world;
  world.looks_until_removed = 2;
  const Ended ended = ExploreIt(world, Quick());
  EXPECT_EQ(ended.result.stop_reason, "nothing_worth_its_cost");
  EXPECT_LE(ended.result.views, 2);
  EXPECT_LT(ended.result.attempts, 20);  // Of 60 it may make.
}

}  // namespace
}  // namespace vantage::session
