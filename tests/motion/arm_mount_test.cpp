// The arm: does it get there, does it touch nothing, does it say why not?
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "geometry/view_sphere.h"
#include "motion/mount.h"
#include "motion/support.h"
#include "support/temp_folder.h"

namespace vantage::motion {
namespace {

MountParams ArmParams() {
  MountParams params;
  params.type = "arm";
  params.arm.urdf = (std::filesystem::path(VANTAGE_SOURCE_DIR) / "config" / "robots" / "arm.urdf").string();
  return params;
}

const MountMaker& Maker() {
  static const MountMaker maker(ArmParams());
  return maker;
}

// A table with an object in the middle and two beside it.
Obstacles Scene() {
  Obstacles obstacles;
  obstacles.boxes.push_back(Box("table", {0, 0, -0.375}, {1.2, 0.8, 0.75}));
  obstacles.hulls.push_back({"object", CubeCorners({0, 0, 0.1}, 0.18)});
  obstacles.hulls.push_back({"left", CubeCorners({0.05, 0.28, 0.08}, 0.14)});
  obstacles.hulls.push_back({"right", CubeCorners({-0.05, -0.28, 0.1}, 0.18)});
  return obstacles;
}

std::vector<geometry::Rigid> Views(int directions, double distance_m) {
  const Eigen::Vector3d centre(0, 0, 0.1);
  std::vector<geometry::Rigid> views;
  for (const Eigen::Vector3d& direction : geometry::EvenDirections(directions)) {
    if (direction.z() < 0.17) continue;
    views.push_back(geometry::LookAt(centre + distance_m * direction, centre, Eigen::Vector3d::UnitZ()));
  }
  return views;
}

geometry::Rigid Front() { return geometry::LookAt({0.5, 0.1, 0.45}, {0, 0, 0.1}, Eigen::Vector3d::UnitZ()); }

TEST(ArmMount, LooksFromWhereItIsAskedToAndTouchesNothing) {
  const Obstacles obstacles = Scene();
  const auto mount = Maker().Make(obstacles);
  const auto start = mount->StanceAt(Front());
  ASSERT_TRUE(start.has_value());
  const auto goals = Views(60, 0.5);
  const auto results = mount->Plan(*start, goals, 1);
  int reached = 0;
  for (std::size_t i = 0; i < goals.size(); ++i) {
    ASSERT_EQ(results[i].refusal.empty(), results[i].trajectory.has_value());
    if (!results[i].trajectory) continue;
    ++reached;
    const Trajectory shorter = mount->Shortened(*results[i].trajectory, 2);
    EXPECT_LE(shorter.duration_s(), results[i].trajectory->duration_s());
    for (const Trajectory* path : {&*results[i].trajectory, &shorter}) {
      const Waypoint& end = path->waypoints.back();
      EXPECT_LT((end.T_world_mount.translation() - goals[i].translation()).norm(), 2e-4);
      EXPECT_LT(geometry::AngleBetween(end.T_world_mount.linear().col(2), goals[i].linear().col(2)), 1e-3);
      EXPECT_LT((path->waypoints.front().joints_rad - start->joints_rad).norm(), 1e-9);
      const PathAudit audit = AuditPath(*path, Maker().Body(), obstacles, 0.02);
      EXPECT_FALSE(audit.touches()) << i << ": " << audit.obstacle << " at " << audit.time_s << " s, " << audit.clearance_m << " m";
    }
  }
  EXPECT_GE(reached, static_cast<int>(goals.size()) / 2);
}

TEST(ArmMount, PosturesByChanceTouch) {  // Or the test above could not fail.
  const Obstacles obstacles = Scene();
  Random random(3);
  int of_itself = 0, of_others = 0;
  for (int i = 0; i < 100; ++i) {
    Waypoint waypoint;
    waypoint.joints_rad = Eigen::VectorXd::NullaryExpr(6, [&] { return random.Uniform(-2.3, 2.3); });
    const PathAudit audit = AuditPath({{waypoint}}, Maker().Body(), obstacles);
    if (audit.touches()) ++(audit.obstacle == "itself" ? of_itself : of_others);
  }
  EXPECT_GE(of_itself, 1);
  EXPECT_GE(of_others, 5);
  EXPECT_LT(of_itself + of_others, 80);
}

TEST(ArmMount, KeepsSpeedAndAccelerationOfEveryJoint) {
  const auto mount = Maker().Make(Scene());
  const auto start = mount->StanceAt(Front());
  ASSERT_TRUE(start.has_value());
  const double speeds[6] = {0.8, 0.8, 0.8, 1.2, 1.2, 1.2};
  for (const auto& result : mount->Plan(*start, Views(30, 0.5), 1)) {
    if (!result.trajectory) continue;
    const Trajectory path = mount->Shortened(*result.trajectory, 0);
    const auto& points = path.waypoints;
    for (std::size_t i = 1; i < points.size(); ++i) {
      const double dt = points[i].time_s - points[i - 1].time_s;
      EXPECT_LE(dt, 0.05 + 1e-9);
      const Eigen::VectorXd rate = (points[i].joints_rad - points[i - 1].joints_rad) / dt;
      for (int j = 0; j < 6; ++j) EXPECT_LE(std::abs(rate[j]), speeds[j] * 1.001);
      if (i < 2) continue;
      const Eigen::VectorXd before = (points[i - 1].joints_rad - points[i - 2].joints_rad) / dt;
      for (int j = 0; j < 6; ++j) EXPECT_LE(std::abs(rate[j] - before[j]) / dt, 1.6 * 1.05);
    }
  }
}

TEST(ArmMount, SaysWhyNot) {
  Obstacles obstacles = Scene();
  obstacles.boxes.push_back(Box("block", {0.45, 0.0, 0.4}, {0.2, 0.3, 0.3}));
  const auto mount = Maker().Make(obstacles);
  EXPECT_EQ(mount->WhyUnreachable(Front()), "in collision");
  EXPECT_EQ(mount->WhyUnreachable(geometry::LookAt({3, 0, 0.5}, {0, 0, 0}, Eigen::Vector3d::UnitZ())), "out of reach");
  EXPECT_FALSE(mount->StanceAt(Front()).has_value());
  const geometry::Rigid side = geometry::LookAt({-0.05, 0.5, 0.5}, {0, 0, 0.1}, Eigen::Vector3d::UnitZ());
  ASSERT_EQ(mount->WhyUnreachable(side), "");
  Stance straight_down(side, Eigen::VectorXd::Constant(6, 0.0));  // Through the table.
  EXPECT_EQ(mount->Plan(straight_down, {side}, 0)[0].refusal, "start in collision");
  straight_down.joints_rad[1] = 9.0;
  EXPECT_EQ(mount->Plan(straight_down, {side}, 0)[0].refusal, "start out of reach");
}

TEST(ArmMount, FindsNoPathThroughAWallAboutItself) {
  Obstacles obstacles;
  const geometry::Rigid left = geometry::LookAt({0.1, 0.5, 0.5}, {0, 0.3, 0.1}, Eigen::Vector3d::UnitZ());
  const geometry::Rigid right = geometry::LookAt({0.1, -0.5, 0.5}, {0, -0.3, 0.1}, Eigen::Vector3d::UnitZ());
  const auto open = Maker().Make(obstacles);
  const auto start = open->StanceAt(left);
  ASSERT_TRUE(start.has_value());
  EXPECT_TRUE(open->Plan(*start, {right}, 0)[0].trajectory.has_value());
  // The plane y = 0 but for a window that the shoulder needs and the elbow cannot pass.
  obstacles.boxes.push_back(Box("wall", {1.48, 0.0, 1.0}, {3.0, 0.02, 4.0}));
  obstacles.boxes.push_back(Box("wall", {-1.98, 0.0, 1.0}, {3.0, 0.02, 4.0}));
  obstacles.boxes.push_back(Box("wall", {-0.25, 0.0, -0.2}, {0.6, 0.02, 1.9}));
  const auto walled = Maker().Make(obstacles);
  ASSERT_EQ(walled->WhyUnreachable(left), "");
  ASSERT_EQ(walled->WhyUnreachable(right), "");
  EXPECT_EQ(walled->Plan(*walled->StanceAt(left), {right}, 0)[0].refusal, "no path found");
}

TEST(ArmMount, SameSeedSamePath) {
  const auto goals = Views(40, 0.5);
  const auto first = Maker().Make(Scene());
  const auto second = Maker().Make(Scene());
  const auto start = first->StanceAt(Front());
  second->Plan(*start, {goals[3]}, 9);  // What was planned before makes no difference.
  const auto a = first->Plan(*start, goals, 4), b = second->Plan(*start, goals, 4);
  for (std::size_t i = 0; i < goals.size(); ++i) {
    ASSERT_EQ(a[i].refusal, b[i].refusal);
    if (a[i].trajectory) {
      EXPECT_EQ(a[i].trajectory->duration_s(), b[i].trajectory->duration_s());
    }
  }
}

TEST(ArmMount, RefusesWhatIsNoArm) {
  MountParams params = ArmParams();
  params.arm.urdf = "nowhere.urdf";
  EXPECT_THROW(MountMaker{params}, std::runtime_error);
  const testing::TempFolder folder;
  params.arm.urdf = (folder.path() / "stick.urdf").string();
  std::ofstream(params.arm.urdf) << "<robot name='stick'><link name='base'/></robot>";
  EXPECT_THROW(MountMaker{params}, std::runtime_error);
  params = ArmParams();
  params.arm.clearance_m = 0.0;
  EXPECT_THROW(MountMaker{params}, std::invalid_argument);
  params.type = "wheels";
  EXPECT_THROW(MountMaker{params}, std::invalid_argument);
}

}  // namespace
}  // namespace vantage::motion
