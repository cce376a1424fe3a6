#include "motion/obstacles.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support.h"

namespace vantage::motion {
namespace {

TEST(CollisionWorld, EmptyIsFreeEverywhere) {
  const CollisionWorld world({}, 0.1);
  EXPECT_TRUE(world.IsFree({0, 0, 0}));
  EXPECT_TRUE(world.IsMoveFree({0, 0, 0}, {1, 2, 3}));
  EXPECT_TRUE(std::isinf(world.Clearance({0, 0, 0})));
}

TEST(CollisionWorld, HullOfCubeCornersIsTheCube) {
  constexpr double kRadius = 0.05;
  const Eigen::Vector3d centre(0.3, -0.2, 0.7);
  Obstacles obstacles;
  obstacles.hulls.push_back({"cube", CubeCorners(centre, 0.2)});
  Random random(1);
  for (int i = 0; i < 200; ++i) obstacles.hulls[0].points_in_world.emplace_back(centre + random.Point(0.1));  // Inside: no change.
  const CollisionWorld world(obstacles, kRadius);
  EXPECT_FALSE(world.IsFree(centre));
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d point = centre + random.Point(0.3);
    const double clearance = DistanceToBox(point, centre, Eigen::Vector3d::Constant(0.2)) - kRadius;
    if (std::abs(clearance) > 1e-5) {
      EXPECT_EQ(world.IsFree(point), clearance > 0.0) << point.transpose();
    }
    if (clearance > -kRadius + 1e-3) {
      EXPECT_NEAR(world.Clearance(point), clearance, 1e-5) << point.transpose();
    }
  }
  EXPECT_LE(world.Clearance(centre), -kRadius + 1e-3);
}

TEST(CollisionWorld, TurnedBoxAndRoundHull) {
  Random random(2);
  Obstacles obstacles;
  BoxObstacle wall = Box("wall", {0.4, 0, 0}, {0.5, 0.02, 0.3});
  wall.T_world_box.linear() = random.Rotation();
  obstacles.boxes.push_back(wall);
  HullObstacle ball{"ball", {}};
  const Eigen::Vector3d centre(-0.5, 0, 0);
  for (int i = 0; i < 3000; ++i) ball.points_in_world.emplace_back(centre + 0.2 * random.Direction());
  obstacles.hulls.push_back(ball);
  const CollisionWorld world(obstacles, 0.03);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d point = random.Point(1.0);
    const double to_wall = DistanceToBox(point, wall), to_ball = (point - centre).norm() - 0.2;
    const double clearance = std::min(to_wall, to_ball) - 0.03;
    if (clearance < -0.02) {
      EXPECT_FALSE(world.IsFree(point));
    } else {
      EXPECT_NEAR(world.Clearance(point), clearance, 0.003) << point.transpose();  // 3000 points are not quite a ball.
    }
  }
}

// A capsule is tested at once: compare with many spheres along the way.
TEST(CollisionWorld, MovesAreFreeWhereEverySphereOnTheWayIs) {
  Random random(3);
  Obstacles obstacles;
  obstacles.boxes.push_back(Box("sheet", {0, 0, 0}, {0.6, 0.6, 0.001}));
  obstacles.hulls.push_back({"cube", CubeCorners({0.4, 0.4, 0.3}, 0.25)});
  const CollisionWorld world(obstacles, 0.04);
  int blocked = 0, free = 0;
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d from = random.Point(0.8), to = random.Point(0.8);
    double clearance = 1.0;
    for (int k = 0; k <= 1000; ++k) {
      const Eigen::Vector3d point = from + (to - from) * k / 1000.0;
      clearance = std::min({clearance, DistanceToBox(point, obstacles.boxes[0]) - 0.04,
                            DistanceToBox(point, {0.4, 0.4, 0.3}, Eigen::Vector3d::Constant(0.25)) - 0.04});
    }
    if (std::abs(clearance) < 1e-4) continue;
    EXPECT_EQ(world.IsMoveFree(from, to), clearance > 0.0) << "clearance " << clearance << " move " << i;
    ++(clearance > 0.0 ? free : blocked);
  }
  EXPECT_GT(blocked, 300);
  EXPECT_GT(free, 300);
  EXPECT_FALSE(world.IsMoveFree({0, 0, -0.5}, {0, 0, 0.5})) << "nothing thin is stepped over";
}

TEST(CollisionWorld, FlatAndSmallHullsAreThickened) {
  const std::vector<std::vector<Eigen::Vector3d>> degenerate = {{{0, 0, 0}},
                                                                {{0, 0, 0}, {0.2, 0, 0}},
                                                                {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}},
                                                                {{0, 0, 0}, {0.2, 0, 0}, {0, 0.2, 0}},
                                                                {{0, 0, 0}, {0.2, 0, 0}, {0, 0.2, 0}, {0.2, 0.2, 0}, {0.1, 0.1, 0}},
                                                                {{0, 0, 0}, {0.1, 0.1, 0.1}, {0.2, 0.2, 0.2}}};
  for (const auto& points : degenerate) {
    const CollisionWorld world({{}, {{"thin", points}}}, 0.01);
    EXPECT_FALSE(world.IsFree({0, 0, 0}));
    EXPECT_NEAR(world.Clearance({-0.5, 0, 0}), 0.49, 0.002);
    EXPECT_TRUE(world.IsFree({-0.05, 0, 0}));
  }
}

TEST(CollisionWorld, RefusesNonsenseByName) {
  const auto message = [](const Obstacles& obstacles, double radius_m) -> std::string {
    try {
      const CollisionWorld world(obstacles, radius_m);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(message({{Box("shelf", {0, 0, 0}, {1, 0, 1})}, {}}, 0.1).find("shelf"), std::string::npos);
  EXPECT_NE(message({{}, {{"mug", {}}}}, 0.1).find("mug"), std::string::npos);
  EXPECT_NE(message({{}, {{"mug", {{0, std::nan(""), 0}}}}}, 0.1).find("mug"), std::string::npos);
  EXPECT_NE(message({}, 0.0).find("radius_m"), std::string::npos);
}

}  // namespace
}  // namespace vantage::motion
