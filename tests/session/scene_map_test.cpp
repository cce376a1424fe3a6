// What stands on the table, gathered over frames.
#include "session/scene_map.h"

#include <gtest/gtest.h>

#include "motion/path_audit.h"
#include "simulation/simulated_world.h"

namespace vantage::session {
namespace {

// How far a point is from the nearest hull; 0 inside.
double DistanceToHulls(const Eigen::Vector3d& point, const std::vector<motion::HullObstacle>& hulls) {
  motion::Trajectory there;
  there.waypoints.resize(1);
  there.waypoints.front().T_world_mount.translation() = point;
  motion::Obstacles obstacles;
  obstacles.hulls = hulls;
  return std::max(0.0, motion::AuditPath(there, motion::CameraBall(1e-6), obstacles).clearance_m);
}

TEST(SceneMap, ObjectsGrowAsTheyAreSeenFromMoreSides) {
  const simulation::SimulatedWorld world(
      simulation::LoadWorldParams(std::filesystem::path(VANTAGE_SOURCE_DIR) / "config" / "worlds" / "table.yaml"));
  SceneMap map;
  EXPECT_TRUE(map.empty());
  const auto look = [&](double azimuth) {
    const Eigen::Vector3d eye(0.6 * std::cos(azimuth), 0.6 * std::sin(azimuth), 0.6);
    const rgbd::Frame frame = world.Look(geometry::LookAt(eye, {0.0, 0.0, 0.05}, Eigen::Vector3d::UnitZ()), 7);
    const auto plane = segmentation::FitPlane(frame, {});
    ASSERT_TRUE(plane.has_value());
    map.Add(frame, *plane, segmentation::FindClusters(frame, *plane, {}));
  };
  // Share of the first object's surface that is inside what is known, or nearly.
  const simulation::TrueObject object = world.Truth().front();
  const auto covered = [&] {
    int inside = 0;
    for (Eigen::Index i = 0; i < object.points.cols(); i += 5) {
      inside += DistanceToHulls(object.T_world_object * Eigen::Vector3d(object.points.col(i)), map.hulls()) < 0.01;
    }
    return 5.0 * inside / static_cast<double>(object.points.cols());
  };
  look(-0.3);
  ASSERT_FALSE(map.empty());
  EXPECT_NEAR(map.plane_in_world()->normal.z(), 1.0, 0.01);
  const double from_one_side = covered();
  for (const double azimuth : {1.2, 2.8, 4.4}) look(azimuth);
  EXPECT_GT(covered(), 0.95);
  EXPECT_GE(covered(), from_one_side);
  EXPECT_EQ(map.hulls().size(), world.Truth().size()) << "each object one hull, however often it was seen";
  EXPECT_LE(DistanceToHulls(world.Truth().back().T_world_object * Eigen::Vector3d(world.Truth().back().points.rowwise().mean()),
                            map.hulls()),
            0.01)
      << "what is not explored is there too";
}

// Seen from so high that the top shows, corners included.
TEST(SceneMap, NoPartOfABoxSticksOutOfWhatOneFrameTells) {
  simulation::WorldParams params;
  simulation::ObjectParams box;
  box.name = "box";
  box.box_m = {0.07, 0.16, 0.21};
  box.faces = {"box.png"};
  params.objects.push_back(box);
  const simulation::SimulatedWorld world(params);
  const simulation::TrueObject object = world.Truth().front();
  for (const double elevation_deg : {30.0, 45.0, 65.0}) {
    for (const double azimuth_deg : {0.0, 20.0, 45.0, 70.0}) {
      SCOPED_TRACE("from " + std::to_string(azimuth_deg) + ", " + std::to_string(elevation_deg));
      const double azimuth = azimuth_deg * M_PI / 180.0, elevation = elevation_deg * M_PI / 180.0;
      const Eigen::Vector3d centre(0.0, 0.0, 0.1),
          direction(std::cos(azimuth) * std::cos(elevation), std::sin(azimuth) * std::cos(elevation), std::sin(elevation));
      const rgbd::Frame frame = world.Look(geometry::LookAt(centre + 0.55 * direction, centre, Eigen::Vector3d::UnitZ()), 7);
      const auto plane = segmentation::FitPlane(frame, {});
      ASSERT_TRUE(plane.has_value());
      SceneMap map;
      map.Add(frame, *plane, segmentation::FindClusters(frame, *plane, {}));
      double most_m = 0.0;
      for (Eigen::Index i = 0; i < object.points.cols(); i += 2) {
        most_m = std::max(most_m, DistanceToHulls(object.T_world_object * Eigen::Vector3d(object.points.col(i)), map.hulls()));
      }
      EXPECT_LT(most_m, 0.01);
    }
  }
}

}  // namespace
}  // namespace vantage::session
