#include "motion/mount.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <ctime>
#include <string>

#include "support.h"

namespace vantage::motion {
namespace {

using geometry::Rigid;

Rigid At(double x, double y, double z, double yaw_rad = 0.0) {
  Rigid pose = Rigid::Identity();
  pose.translation() = Eigen::Vector3d(x, y, z);
  pose.linear() = Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return pose;
}

double Length(const Trajectory& trajectory) {
  double length_m = 0.0;
  for (std::size_t i = 1; i < trajectory.waypoints.size(); ++i) {
    length_m +=
        (trajectory.waypoints[i].T_world_mount.translation() - trajectory.waypoints[i - 1].T_world_mount.translation()).norm();
  }
  return length_m;
}

// The body's least distance to boxes, every 5 mm of the trajectory; worked out by hand.
double LeastClearance(const Trajectory& trajectory, const std::vector<BoxObstacle>& boxes, double radius_m) {
  double least_m = 1e9;
  const double step_s = 0.005 / 0.25;
  for (double t = 0.0; t < trajectory.duration_s() + step_s; t += step_s) {
    for (const BoxObstacle& box : boxes) least_m = std::min(least_m, DistanceToBox(trajectory.At(t).translation(), box) - radius_m);
  }
  return least_m;
}

// A table with three things on it; the things' hulls are boxes too, so that distances can be worked out.
struct TableScene {
  Obstacles obstacles;
  std::vector<BoxObstacle> all;

  TableScene() {
    obstacles.boxes.push_back(Box("table", {0, 0, -0.02}, {1.2, 0.8, 0.04}));
    all = obstacles.boxes;
    int i = 0;
    for (const Eigen::Vector3d& at :
         {Eigen::Vector3d(0, 0, 0.1), Eigen::Vector3d(0.3, 0.1, 0.1), Eigen::Vector3d(-0.3, -0.1, 0.1)}) {
      obstacles.hulls.push_back({"thing " + std::to_string(i++), CubeCorners(at, 0.2)});
      all.push_back(Box("thing", at, Eigen::Vector3d::Constant(0.2)));
    }
  }

  static std::vector<Rigid> GoalsAround(int count, double distance_m) {
    std::vector<Rigid> goals;
    for (int i = 0; i < count; ++i) {
      const double azimuth = 2.4 * i, elevation = 0.25 + 1.0 * i / count;
      const Eigen::Vector3d direction(std::cos(azimuth) * std::cos(elevation), std::sin(azimuth) * std::cos(elevation),
                                      std::sin(elevation));
      goals.push_back(geometry::LookAt(distance_m * direction, {0, 0, 0.1}, Eigen::Vector3d::UnitZ()));
    }
    return goals;
  }
};

TEST(FreeMount, FliesStraightWhereItCan) {
  const auto mount = MakeFreeMount({}, {});
  const Rigid start = At(0, 0, 0), goal = At(1, 0.2, 0.5, 0.3);
  const auto results = mount->Plan(start, {goal}, 0);
  ASSERT_TRUE(results[0].trajectory) << results[0].refusal;
  EXPECT_EQ(results[0].refusal, "");
  EXPECT_NEAR(Length(*results[0].trajectory), (goal.translation() - start.translation()).norm(), 1e-6);
  EXPECT_TRUE(results[0].trajectory->At(0.0).isApprox(start));
  EXPECT_TRUE(results[0].trajectory->At(1e9).isApprox(goal));
}

TEST(FreeMount, GoesAroundAWall) {
  Obstacles obstacles;
  obstacles.boxes.push_back(Box("wall", {0, 0, 0}, {0.05, 1.6, 1.6}));
  const FreeMountParams params;
  const auto mount = MakeFreeMount(params, obstacles);
  for (std::uint32_t seed = 0; seed < 10; ++seed) {
    SCOPED_TRACE(seed);
    const Rigid start = At(-0.5, 0, 0), goal = At(0.5, 0, 0, 1.2);
    const auto results = mount->Plan(start, {goal}, seed);
    ASSERT_TRUE(results[0].trajectory) << results[0].refusal;
    const Trajectory& trajectory = *results[0].trajectory;
    EXPECT_GE(LeastClearance(trajectory, obstacles.boxes, params.camera_radius_m), params.clearance_m - 1e-4);
    // Around the edge 0.8 m off: at least 1.99 m; the straight line would be 1 m.
    EXPECT_GT(Length(trajectory), 1.95);
    EXPECT_LT(Length(trajectory), 2.5) << "the path is shortened";
    EXPECT_TRUE(trajectory.At(0.0).isApprox(start));
    EXPECT_TRUE(trajectory.At(1e9).isApprox(goal));
    // It turns along the way, evenly: half way about half of the turn.
    double turned = 0.0, last = 0.0;
    for (double t = 0.0; t <= trajectory.duration_s(); t += 0.05) {
      turned = geometry::Difference(start, trajectory.At(t)).rotation_rad;
      EXPECT_GE(turned, last - 1e-6);
      last = turned;
    }
    EXPECT_NEAR(geometry::Difference(start, trajectory.At(trajectory.duration_s() / 2)).rotation_rad, 0.6, 0.3);
  }
}

TEST(FreeMount, StartsWhereAnObstacleGrewNearer) {
  Obstacles obstacles;
  obstacles.boxes.push_back(Box("wall", {0, 0, 0}, {0.05, 1.6, 1.6}));
  const FreeMountParams params;
  const auto mount = MakeFreeMount(params, obstacles);
  const double touching = -0.025 - params.camera_radius_m;
  const auto results = mount->Plan(At(touching - 0.5 * params.clearance_m, 0, 0), {At(-0.5, 0.3, 0), At(0.5, 0, 0)}, 0);
  for (const PathResult& result : results) {
    ASSERT_TRUE(result.trajectory) << result.refusal;
    EXPECT_GE(LeastClearance(*result.trajectory, obstacles.boxes, params.camera_radius_m), 0.5 * params.clearance_m - 2e-3);
  }
  EXPECT_EQ(mount->Plan(At(touching + 0.01, 0, 0), {At(-0.5, 0.3, 0)}, 0)[0].refusal, "start in collision");
}

TEST(FreeMount, ATrajectoryThroughTheTableSceneTouchesNothing) {
  const TableScene scene;
  const FreeMountParams params;
  const auto mount = MakeFreeMount(params, scene.obstacles);
  const Rigid start = geometry::LookAt({0.45, -0.1, 0.15}, {0, 0, 0.1}, Eigen::Vector3d::UnitZ());
  const auto goals = TableScene::GoalsAround(60, 0.5);
  const auto results = mount->Plan(start, goals, 5);
  int found = 0;
  for (std::size_t i = 0; i < goals.size(); ++i) {
    ASSERT_NE(results[i].trajectory.has_value(), !results[i].refusal.empty());
    const bool touches = !mount->WhyUnreachable(goals[i]).empty();
    EXPECT_EQ(results[i].refusal == "in collision", touches);
    if (!results[i].trajectory) continue;
    ++found;
    EXPECT_GE(LeastClearance(*results[i].trajectory, scene.all, params.camera_radius_m), params.clearance_m - 1e-4) << "goal " << i;
    EXPECT_TRUE(results[i].trajectory->At(1e9).isApprox(goals[i]));
  }
  EXPECT_GT(found, 50);
}

TEST(FreeMount, SaysWhyThereIsNoPath) {
  Obstacles obstacles;  // A closed box around (1, 0, 0.5), inside which there is room.
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-0.3, 0.3}) {
      Eigen::Vector3d centre(1, 0, 0.5), size = Eigen::Vector3d::Constant(0.64);
      centre[axis] += side;
      size[axis] = 0.04;
      obstacles.boxes.push_back(Box("side", centre, size));
    }
  }
  const auto mount = MakeFreeMount({}, obstacles);
  const auto results =
      mount->Plan(At(0, 0, 0), {At(1, 0, 0.5), At(1.3, 0, 0.5), At(9, 0, 0), At(0, 0, 0.4), At(0, std::nan(""), 0)}, 0);
  ASSERT_EQ(results.size(), 5u);
  EXPECT_EQ(results[0].refusal, "no path found");
  EXPECT_EQ(results[1].refusal, "in collision");
  EXPECT_EQ(results[2].refusal, "out of the workspace");
  EXPECT_EQ(results[3].refusal, "");
  EXPECT_EQ(results[4].refusal, "out of the workspace");
  for (std::size_t i = 0; i < results.size(); ++i) EXPECT_EQ(results[i].trajectory.has_value(), i == 3);
  EXPECT_EQ(mount->WhyUnreachable(At(1.3, 0, 0.5)), "in collision");
  EXPECT_EQ(mount->WhyUnreachable(At(9, 0, 0)), "out of the workspace");
  EXPECT_EQ(mount->WhyUnreachable(At(1, 0, 0.5)), "") << "room enough, though no way in";
  EXPECT_EQ(mount->Plan(At(1.3, 0, 0.5), {At(0, 0, 0)}, 0)[0].refusal, "start in collision");
  EXPECT_EQ(mount->Plan(At(9, 0, 0.5), {At(0, 0, 0)}, 0)[0].refusal, "start out of the workspace");
  EXPECT_TRUE(mount->Plan(At(0, 0, 0), {}, 0).empty());
}

TEST(FreeMount, SameSeedSamePath) {
  const TableScene scene;
  const auto goals = TableScene::GoalsAround(40, 0.55);
  const Rigid start = geometry::LookAt({-0.6, 0.1, 0.12}, {0, 0, 0.1}, Eigen::Vector3d::UnitZ());
  const auto first = MakeFreeMount({}, scene.obstacles)->Plan(start, goals, 7);
  const auto mount = MakeFreeMount({}, scene.obstacles);
  mount->Plan(start, goals, 8);  // What was planned before makes no difference.
  const auto second = mount->Plan(start, goals, 7);
  int bent = 0;
  for (std::size_t i = 0; i < goals.size(); ++i) {
    ASSERT_EQ(first[i].refusal, second[i].refusal);
    if (!first[i].trajectory) continue;
    const auto &a = first[i].trajectory->waypoints, &b = second[i].trajectory->waypoints;
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t k = 0; k < a.size(); ++k) {
      ASSERT_EQ(a[k].time_s, b[k].time_s);
      ASSERT_EQ(a[k].T_world_mount.matrix(), b[k].T_world_mount.matrix());
    }
    if (Length(*first[i].trajectory) > (goals[i].translation() - start.translation()).norm() + 1e-3) ++bent;
  }
  EXPECT_GT(bent, 5) << "the scene must need the roadmap";
}

// A number that any change of the path around a wall would change.
std::string PathDigest() {
  Obstacles obstacles;
  obstacles.boxes.push_back(Box("wall", {0, 0, 0}, {0.05, 1.6, 1.6}));
  const auto results = MakeFreeMount({}, obstacles)->Plan(At(-0.5, 0, 0), {At(0.5, 0, 0)}, 3);
  char text[64];
  std::snprintf(text, sizeof text, "%a", results[0].trajectory->duration_s());
  return text;
}

// What the next test runs in other processes.
TEST(FreeMount, PrintsADigest) { std::printf("digest %s\n", PathDigest().c_str()); }

TEST(FreeMount, SamePathInEveryProcess) {
  char self[4096] = {};
  ASSERT_GT(readlink("/proc/self/exe", self, sizeof self - 1), 0);
  const std::string command = std::string("'") + self + "' --gtest_filter=FreeMount.PrintsADigest --gtest_output=";
  for (int run = 0; run < 2; ++run) {
    FILE* pipe = popen(command.c_str(), "r");
    ASSERT_NE(pipe, nullptr);
    std::string output;
    for (int c = std::fgetc(pipe); c != EOF; c = std::fgetc(pipe)) output.push_back(static_cast<char>(c));
    ASSERT_EQ(pclose(pipe), 0) << output;
    EXPECT_NE(output.find("digest " + PathDigest() + "\n"), std::string::npos) << output;
  }
}

TEST(FreeMount, FurtherTakesLonger) {
  const auto mount = MakeFreeMount({}, {});
  const auto results = mount->Plan(At(-1, 0, 0), {At(-0.5, 0, 0), At(0, 0, 0), At(1, 0, 0)}, 0);
  EXPECT_NEAR(results[0].trajectory->duration_s(), 0.5 / 0.25 + 0.5, 0.02);
  EXPECT_NEAR(results[1].trajectory->duration_s(), 1.0 / 0.25 + 0.5, 0.03);
  EXPECT_NEAR(results[2].trajectory->duration_s(), 2.0 / 0.25 + 0.5, 0.05);
}

TEST(FreeMount, PlansManyGoalsFast) {
  const TableScene scene;
  const auto goals = TableScene::GoalsAround(150, 0.55);
  const Rigid start = geometry::LookAt({-0.6, 0.1, 0.12}, {0, 0, 0.1}, Eigen::Vector3d::UnitZ());
  const auto mount = MakeFreeMount({}, scene.obstacles);
  const std::clock_t begin = std::clock();  // Processor time: the machine may be busy with other things.
  mount->Plan(start, goals, 7);
  const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  RecordProperty("seconds", std::to_string(seconds));
  EXPECT_LT(seconds, 0.5);
}

TEST(FreeMountParams, CheckNamesTheField) {
  const auto message = [](const FreeMountParams& params) -> std::string {
    try {
      params.Check();
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  FreeMountParams params;
  EXPECT_EQ(message(params), "");
  params.camera_radius_m = -1.0;
  EXPECT_NE(message(params).find("camera_radius_m"), std::string::npos);
  params = {};
  params.clearance_m = -1.0;
  EXPECT_NE(message(params).find("clearance_m"), std::string::npos);
  params = {};
  params.workspace_upper_m.z() = -1.0;
  EXPECT_NE(message(params).find("workspace_lower_m"), std::string::npos);
  params = {};
  params.roadmap_samples = -1;
  EXPECT_NE(message(params).find("roadmap_samples"), std::string::npos);
  params = {};
  params.limits.max_speed_m_s = 0.0;
  EXPECT_NE(message(params).find("max_speed_m_s"), std::string::npos);
}

}  // namespace
}  // namespace vantage::motion
