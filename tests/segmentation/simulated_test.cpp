// Objects cut out of simulated frames that have a Kinect's errors: boxes that touch, stand on each other or hide each other, meshes
// that must stay whole, and tables and cameras that are not as they should be.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <random>

#include "segmentation/overlap.h"
#include "simulation/simulated_world.h"
#include "simulation/small_world.h"
#include "support/data.h"

namespace vantage::segmentation {
namespace {

using Eigen::Vector3d;
using simulation::SimulatedWorld;
using simulation::WorldParams;

// Clusters that have most of their pixels on objects: what else a room holds is not meant.
int ClustersOn(const std::vector<Cluster>& clusters, const cv::Mat& objects) {
  int count = 0;
  for (const Cluster& cluster : clusters) count += 2 * cv::countNonZero(cluster.mask & objects) > cv::countNonZero(cluster.mask);
  return count;
}

// A camera that looks at a point 0.06 m above the table's middle, rolled about its axis.
geometry::Rigid Around(double azimuth_deg, double elevation_deg, double distance_m, double roll_deg = 0.0) {
  const double azimuth = azimuth_deg * M_PI / 180.0, elevation = elevation_deg * M_PI / 180.0;
  const Vector3d target(0.0, 0.0, 0.06);
  const Vector3d ray(std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
  geometry::Rigid pose = geometry::LookAt(target + distance_m * ray, target, {0, 0, 1});
  pose.rotate(Eigen::AngleAxisd(roll_deg * M_PI / 180.0, Vector3d::UnitZ()));
  return pose;
}

// A frame and the truth about it.
struct Seen {
  rgbd::Frame frame;
  cv::Mat labels;  // CV_32SC1: the object's index, -1 = none.
  geometry::Rigid T_world_camera;

  Seen(const SimulatedWorld& world, const geometry::Rigid& pose, unsigned seed)
      : frame(world.Look(pose, seed)), labels(world.Labels(pose)), T_world_camera(pose) {}
  cv::Mat Mask(int object) const { return labels == object; }
  cv::Mat Objects() const { return labels >= 0; }
  Vector3d WorldPoint(int x, int y) const {
    return T_world_camera * frame.camera.Unproject(Eigen::Vector2d(x, y), 0.001 * frame.depth.at<std::uint16_t>(y, x));
  }
};

class Simulated : public ::testing::Test {
 protected:
  // Boxes: size, and where the middle of the foot stands.
  WorldParams Boxes(const std::vector<std::pair<Vector3d, Vector3d>>& boxes) const { return pictures_.World(boxes); }

 private:
  simulation::testing::PictureFolder pictures_;
};

TEST_F(Simulated, BoxesThatTouchOrStandOnEachOtherAreParted) {
  const SimulatedWorld world(Boxes({{{0.20, 0.25, 0.08}, {0.0, -0.12, 0.0}},
                                    {{0.07, 0.10, 0.16}, {0.02, -0.12, 0.08}},  // On the first.
                                    {{0.15, 0.08, 0.10}, {0.0, 0.17, 0.0}},
                                    {{0.10, 0.10, 0.20}, {0.0, 0.26, 0.0}}}));  // Touches the third.
  int objects = 0, parted = 0, creases_ignored = 0;
  for (const double azimuth_deg : {-40.0, 0.0, 30.0}) {
    const Seen seen(world, Around(azimuth_deg, 35.0, 0.9), 1);
    const auto clusters = Segment(seen.frame);
    ClusterParams ignore;
    ignore.min_crease_deg = 180.0;
    const auto joined = Segment(seen.frame, ignore);
    for (int object = 0; object < 4; ++object) {
      ++objects;
      parted += BestOverlap(clusters, seen.Mask(object)) > 0.8;
      creases_ignored += BestOverlap(joined, seen.Mask(object)) > 0.8;
    }
  }
  EXPECT_GE(parted, objects - 1) << "of " << objects;
  EXPECT_LE(creases_ignored, objects / 2) << "they stand so that creases matter";
}

TEST_F(Simulated, ObjectsThatTouchInTheImageOnlyAreParted) {
  // The back one is seen over the front one's top, 40 mm behind it.
  const SimulatedWorld world(Boxes({{{0.06, 0.20, 0.10}, {0.10, 0.0, 0.0}}, {{0.06, 0.20, 0.20}, {0.0, 0.02, 0.0}}}));
  for (const unsigned seed : {1u, 2u, 3u}) {
    const Seen seen(world, Around(0.0, 20.0, 0.7), seed);
    const auto clusters = Segment(seen.frame);
    EXPECT_EQ(ClustersOn(clusters, seen.Objects()), 2);
    for (const int object : {0, 1}) EXPECT_GT(BestOverlap(clusters, seen.Mask(object)), 0.85) << object;
  }
}

TEST_F(Simulated, TheDepthCutOffGrowsWithTheNoise) {
  ClusterParams by_jumps;
  by_jumps.min_crease_deg = 180.0;
  // Far away depth comes in steps of 12 mm.
  WorldParams params = Boxes({{{0.20, 0.30, 0.25}, {0.0, 0.0, 0.0}}});
  params.objects[0].yaw_deg = 35.0;
  const SimulatedWorld alone(params);
  const Seen far(alone, Around(0.0, 30.0, 1.9), 1);
  EXPECT_EQ(ClustersOn(Segment(far.frame, by_jumps), far.Objects()), 1);
  EXPECT_GT(BestOverlap(Segment(far.frame, by_jumps), far.Mask(0)), 0.85);
  // Nearby 25 mm are enough to part two: behind the top of the front one the back one begins.
  const SimulatedWorld two(Boxes({{{0.06, 0.20, 0.10}, {0.06, 0.0, 0.0}}, {{0.06, 0.20, 0.20}, {-0.025, 0.0, 0.0}}}));
  const Seen near(two, Around(0.0, 20.0, 0.55), 1);
  EXPECT_EQ(ClustersOn(Segment(near.frame, by_jumps), near.Objects()), 2);
  ClusterParams not_growing = by_jumps;
  not_growing.max_jump_m *= 1.9 * 1.9 / 0.25;  // At 0.55 m what is right at 1.9 m.
  EXPECT_EQ(ClustersOn(Segment(near.frame, not_growing), near.Objects()), 1);
}

TEST_F(Simulated, MissingDepthOnDarkAndShinyPartsPartsNothing) {
  const SimulatedWorld world(Boxes({{{0.10, 0.16, 0.18}, {0.0, 0.0, 0.0}}}));
  for (const unsigned seed : {1u, 2u, 3u}) {
    Seen seen(world, Around(10.0, 25.0, 0.7), seed);
    const cv::Rect box = cv::boundingRect(seen.Mask(0));
    cv::Mat dark(seen.labels.size(), CV_8UC1, cv::Scalar(0));
    dark(cv::Rect(box.x + box.width / 2, box.y, 14, box.height)).setTo(255);  // A dark stripe from top to bottom.
    std::mt19937 random(seed);
    for (int spot = 0; spot < 12; ++spot) {  // Highlights.
      const cv::Point middle(box.x + static_cast<int>(random() % box.width), box.y + static_cast<int>(random() % box.height));
      cv::circle(dark, middle, 6, cv::Scalar(255), cv::FILLED);
    }
    seen.frame.depth.setTo(0, dark & seen.Mask(0));
    const auto clusters = Segment(seen.frame);
    EXPECT_EQ(ClustersOn(clusters, seen.Objects()), 1);
    EXPECT_GT(BestOverlap(clusters, seen.Mask(0)), 0.8) << "a tenth of it is not measured";
  }
}

TEST_F(Simulated, WhatANearerObjectCutsInTwoIsOneAndTwoBehindItAreTwo) {
  const std::pair<Vector3d, Vector3d> post{{0.05, 0.07, 0.25}, {0.12, 0.0, 0.0}};
  const SimulatedWorld one(Boxes({post, {{0.06, 0.40, 0.10}, {-0.05, 0.0, 0.0}}}));
  const Seen cut(one, Around(0.0, 25.0, 0.8), 1);
  EXPECT_EQ(ClustersOn(Segment(cut.frame), cut.Objects()), 2);
  EXPECT_GT(BestOverlap(Segment(cut.frame), cut.Mask(1)), 0.85);

  const SimulatedWorld two(Boxes({post, {{0.06, 0.17, 0.10}, {-0.05, -0.115, 0.0}}, {{0.06, 0.17, 0.13}, {-0.10, 0.115, 0.0}}}));
  const Seen beside(two, Around(0.0, 25.0, 0.8), 1);
  const auto clusters = Segment(beside.frame);
  EXPECT_EQ(ClustersOn(clusters, beside.Objects()), 3);
  for (const int object : {1, 2}) EXPECT_GT(BestOverlap(clusters, beside.Mask(object)), 0.8) << object;
}

TEST_F(Simulated, BoxesOfOneHeightBehindEachOtherAreNoVessel) {
  const SimulatedWorld world(Boxes({{{0.03, 0.20, 0.15}, {0.06, 0.0, 0.0}}, {{0.03, 0.20, 0.15}, {-0.06, 0.0, 0.0}}}));
  const Seen seen(world, Around(0.0, 40.0, 0.8), 1);
  EXPECT_EQ(ClustersOn(Segment(seen.frame), seen.Objects()), 2);
}

TEST_F(Simulated, ACroppedTableIsFound) {
  const SimulatedWorld world(Boxes({{{0.08, 0.12, 0.15}, {0.0, 0.0, 0.0}}}));
  Seen seen(world, Around(20.0, 35.0, 0.9), 1);
  for (int y = 0; y < seen.labels.rows; ++y) {
    for (int x = 0; x < seen.labels.cols; ++x) {
      const Vector3d point = seen.WorldPoint(x, y);
      if (std::abs(point.x()) > 0.2 || std::abs(point.y()) > 0.2) seen.frame.depth.at<std::uint16_t>(y, x) = 0;
    }
  }
  const auto plane = FitPlane(seen.frame, {});
  ASSERT_TRUE(plane);
  EXPECT_NEAR(plane->offset_m, seen.T_world_camera.translation().z(), 0.004);
  EXPECT_GT(BestOverlap(Segment(seen.frame), seen.Mask(0)), 0.85);
}

TEST_F(Simulated, ASmallTableIsTakenNotTheFloorUnderIt) {
  WorldParams params = Boxes({{{0.08, 0.12, 0.15}, {0.0, 0.0, 0.0}}});
  params.table_size_x_m = 0.45;
  params.table_size_y_m = 0.5;
  const SimulatedWorld world(params);
  for (const double elevation_deg : {35.0, 55.0}) {
    const Seen seen(world, Around(20.0, elevation_deg, 1.0), 1);
    const auto plane = FitPlane(seen.frame, {});
    ASSERT_TRUE(plane);
    EXPECT_NEAR(plane->offset_m, seen.T_world_camera.translation().z(), 0.004) << elevation_deg;
    EXPECT_GT(BestOverlap(Segment(seen.frame), seen.Mask(0)), 0.85) << elevation_deg;
  }
}

TEST_F(Simulated, ATiltedCameraFindsTableAndObject) {
  const SimulatedWorld world(Boxes({{{0.08, 0.12, 0.15}, {0.0, 0.0, 0.0}}}));
  for (const auto& [elevation_deg, roll_deg] :
       {std::pair(40.0, 45.0), std::pair(40.0, -45.0), std::pair(20.0, 20.0), std::pair(85.0, 0.0), std::pair(75.0, 90.0)}) {
    SCOPED_TRACE(std::to_string(elevation_deg) + " rolled " + std::to_string(roll_deg));
    const Seen seen(world, Around(20.0, elevation_deg, 0.8, roll_deg), 1);
    const auto plane = FitPlane(seen.frame, {});
    ASSERT_TRUE(plane);
    EXPECT_LT(std::acos(std::min(1.0, (seen.T_world_camera.linear() * plane->normal).z())), 0.015);
    const auto clusters = Segment(seen.frame);
    EXPECT_EQ(ClustersOn(clusters, seen.Objects()), 1);
    EXPECT_GT(BestOverlap(clusters, seen.Mask(0)), 0.85);
  }
}

TEST_F(Simulated, WithoutATableThereIsNone) {
  const SimulatedWorld world(Boxes({{{0.08, 0.12, 0.15}, {0.0, 0.0, 0.0}}}));
  Seen seen(world, Around(20.0, 35.0, 0.7), 1);
  seen.frame.depth.setTo(0, ~seen.Objects());
  EXPECT_FALSE(FitPlane(seen.frame, {})) << "a box's own side is no table";
}

TEST(SimulatedMeshes, OneAloneIsOneClusterHandleCapAndHollowIncluded) {
  VANTAGE_NEEDS_DATA("meshes");
  unsigned seed = 0;
  for (const char* name : {"003_cracker_box", "006_mustard_bottle", "021_bleach_cleanser", "024_bowl", "025_mug"}) {
    SCOPED_TRACE(name);
    const SimulatedWorld world(simulation::WorldWithMeshes({}, {testing::DataFolder() / "meshes" / name / "textured.obj"}));
    for (int i = 0; i < 8; ++i) {
      const Seen seen(world, Around(52.0 * i, i % 2 ? 45.0 : 25.0, i < 4 ? 0.6 : 0.9), ++seed);
      const auto clusters = Segment(seen.frame);
      EXPECT_EQ(ClustersOn(clusters, seen.Objects()), 1) << "view " << i;
      EXPECT_GT(BestOverlap(clusters, seen.Mask(0)), 0.8) << "view " << i;
    }
  }
}

}  // namespace
}  // namespace vantage::segmentation
