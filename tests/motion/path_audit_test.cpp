// The second opinion on paths: it must find what is there, and only that.
#include "motion/path_audit.h"

#include <gtest/gtest.h>

#include "geometry/view_sphere.h"
#include "motion/mount.h"
#include "motion/support.h"

namespace vantage::motion {
namespace {

geometry::Rigid At(double x, double y, double z) {
  geometry::Rigid pose = geometry::Rigid::Identity();
  pose.translation() = Eigen::Vector3d(x, y, z);
  return pose;
}

Trajectory Straight(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  return TimePath({At(from.x(), from.y(), from.z()), At(to.x(), to.y(), to.z())}, {});
}

HullObstacle Ball(const Eigen::Vector3d& centre, double radius_m) {
  HullObstacle hull;
  hull.name = "ball";
  for (const Eigen::Vector3d& direction : geometry::EvenDirections(2000))
    hull.points_in_world.push_back(centre + radius_m * direction);
  return hull;
}

TEST(PathAudit, MeasuresDistancesToBoxesAndHulls) {
  Obstacles box, ball;
  box.boxes.push_back(Box("box", {0, 0, 0}, {0.2, 0.2, 0.2}));
  ball.hulls.push_back(Ball({0, 0, 0}, 0.1));
  for (const double gap_m : {0.03, 0.01, 0.002, -0.002, -0.01}) {
    const Trajectory path = Straight({-0.5, 0, 0.16 + gap_m}, {0.5, 0, 0.16 + gap_m});
    EXPECT_NEAR(AuditPath(path, CameraBall(0.06), box).clearance_m, gap_m, 1e-6);
    EXPECT_NEAR(AuditPath(path, CameraBall(0.06), ball).clearance_m, gap_m, 0.001);
    EXPECT_EQ(AuditPath(path, CameraBall(0.06), ball).touches(), gap_m < 0.0);
  }
  const PathAudit audit = AuditPath(Straight({-0.5, 0, 0.1}, {0.5, 0, 0.1}), CameraBall(0.06), box);
  EXPECT_EQ(audit.obstacle, "box");
  EXPECT_GT(audit.time_s, 1.0);
}

TEST(PathAudit, FindsAThinWallAndAPointInside) {
  Obstacles wall;
  wall.boxes.push_back(Box("wall", {0, 0, 0}, {0.002, 1.0, 1.0}));
  EXPECT_TRUE(AuditPath(Straight({-0.5, 0, 0}, {0.5, 0, 0}), CameraBall(0.001), wall).touches());
  Obstacles ball;
  ball.hulls.push_back(Ball({0.2, 0, 0}, 0.05));
  EXPECT_TRUE(AuditPath(Straight({-0.5, 0, 0}, {0.5, 0, 0}), CameraBall(0.0), ball).touches());
  EXPECT_FALSE(AuditPath(Straight({-0.5, 0.1, 0}, {0.5, 0.1, 0}), CameraBall(0.0), ball).touches());
  EXPECT_EQ(AuditPath(Straight({-0.5, 1, 0}, {0.5, 1, 0}), CameraBall(0.1), ball).clearance_m, kFarAudit_m);
}

// Many points of a body that pass by: what each of them leaves undecided must not add up to a touch.
TEST(PathAudit, ManyPointsAreNoNearerThanTheNearest) {
  Obstacles obstacles;
  obstacles.hulls.push_back({"cube", CubeCorners({0, 0, 0}, 0.2)});
  obstacles.hulls.push_back(Ball({0.1, 0.25, 0}, 0.1));
  const auto sheet = [](const Waypoint& waypoint) {
    MountBody body;
    for (int x = -10; x <= 10; ++x) {
      for (int y = -10; y <= 10; ++y)
        body.balls.push_back({waypoint.T_world_mount * Eigen::Vector3d(0.02 * x, 0.02 * y, 0.0), 0.0});
    }
    return body;
  };
  for (const double gap_m : {0.03, 0.01, 0.002}) {
    const double height_m = 0.1 + gap_m;
    EXPECT_NEAR(AuditPath(Straight({-0.5, 0, height_m}, {0.5, 0.1, height_m}), sheet, obstacles, 0.02).clearance_m, gap_m, 0.001);
  }
}

TEST(PathAudit, AgreesWithThePlannerAboutPlannedPathsAndNotAboutStraightOnes) {
  Obstacles obstacles;
  obstacles.boxes.push_back(Box("wall", {0, 0, 0.3}, {0.05, 0.8, 0.8}));
  obstacles.hulls.push_back(Ball({0.3, 0.5, 0.2}, 0.15));
  const FreeMountParams params;
  std::vector<geometry::Rigid> goals;
  for (const double y : {-0.4, -0.2, 0.0, 0.2, 0.4, 0.8}) goals.push_back(At(0.6, y, 0.3));
  const auto results = MakeFreeMount(params, obstacles)->Plan(At(-0.5, 0, 0.3), goals, 3);
  int straight_touches = 0;
  for (std::size_t i = 0; i < goals.size(); ++i) {
    ASSERT_TRUE(results[i].trajectory.has_value());
    EXPECT_FALSE(AuditPath(*results[i].trajectory, CameraBall(params.camera_radius_m), obstacles).touches());
    const Trajectory straight = TimePath({At(-0.5, 0, 0.3), goals[i]}, {});
    straight_touches += AuditPath(straight, CameraBall(params.camera_radius_m), obstacles).touches();
  }
  EXPECT_GE(straight_touches, 4) << "or the check cannot fail";
}

TEST(PathAudit, RefusesNonsense) {
  EXPECT_THROW(AuditPath(Straight({0, 0, 0}, {1, 0, 0}), CameraBall(0.1), {}, 0.0), std::invalid_argument);
  Obstacles empty;
  empty.hulls.push_back({"nothing", {}});
  EXPECT_THROW(AuditPath(Straight({0, 0, 0}, {1, 0, 0}), CameraBall(0.1), empty), std::invalid_argument);
}

}  // namespace
}  // namespace vantage::motion
