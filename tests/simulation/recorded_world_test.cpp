#include "simulation/recorded_world.h"

#include <gtest/gtest.h>

#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "rendering/mesh.h"
#include "support/data.h"

namespace vantage::simulation {
namespace {

TEST(RecordedWorld, BoardStandsTheRightWayUp) {
  VANTAGE_NEEDS_DATA("board");
  const auto scene = std::make_shared<const rgbd::BopScene>(testing::DataFolder() / "board");
  const RecordedWorld world(scene, rgbd::SelectFrames(scene->ids(), "even"));
  ASSERT_EQ(world.Viewpoints().size(), world.ids().size());
  for (const geometry::Rigid& pose : world.Viewpoints()) {
    EXPECT_GT(pose.translation().z(), 0.05);
    EXPECT_LT(pose.linear()(2, 2), 0.1) << "cameras look down at the table";
    EXPECT_NEAR(pose.linear().determinant(), 1.0, 1e-5);
  }
  EXPECT_TRUE(world.StartPose().isApprox(world.Viewpoints().front()));
}

TEST(RecordedWorld, TrueObjectsStandOnTheTable) {
  VANTAGE_NEEDS_DATA("board");
  VANTAGE_NEEDS_DATA("meshes");
  const auto scene = std::make_shared<const rgbd::BopScene>(testing::DataFolder() / "board");
  const RecordedWorld world(scene, scene->ids());
  const std::vector<TrueObject> truth = world.Truth();
  ASSERT_EQ(truth.size(), 2u);
  for (const TrueObject& object : truth) {
    const bool box = object.name == "object_3";
    EXPECT_EQ(object.name, box ? "object_3" : "object_6");
    const auto mesh =
        rendering::LoadMesh(testing::DataFolder() / "meshes" / (box ? "003_cracker_box" : "006_mustard_bottle") / "textured.obj");
    const Eigen::Matrix3Xd points = object.T_world_object * rendering::SampleSurface(mesh, 5000, 1);
    EXPECT_NEAR(points.row(2).minCoeff(), 0.0, 0.012) << object.name;
    EXPECT_NEAR(points.row(2).maxCoeff(), box ? 0.21 : 0.19, 0.02) << object.name;
  }
  // The same from every frame.
  const int id = scene->ids().back();
  for (const rgbd::ObjectTruth& there : scene->Truth(id)) {
    const geometry::Rigid T_world_object = world.T_world_recording() * *scene->CameraPose(id) * there.T_camera_object;
    for (const TrueObject& object : truth) {
      if (object.name != "object_" + std::to_string(there.object_id)) continue;
      EXPECT_LT(geometry::Difference(object.T_world_object, T_world_object).translation_m, 0.005);
    }
  }
}

TEST(RecordedWorld, LookShowsTheNearestFrameAndSaysWhich) {
  VANTAGE_NEEDS_DATA("board");
  const auto scene = std::make_shared<const rgbd::BopScene>(testing::DataFolder() / "board");
  const RecordedWorld world(scene, rgbd::SelectFrames(scene->ids(), "even"));
  const std::size_t chosen = 5;
  geometry::Rigid near_it = world.Viewpoints()[chosen];
  near_it.translation().x() += 0.003;
  const rgbd::Frame frame = world.Look(near_it, 0);
  EXPECT_EQ(frame.id, world.ids()[chosen]);
  ASSERT_TRUE(frame.T_world_camera.has_value());
  EXPECT_TRUE(frame.T_world_camera->isApprox(world.Viewpoints()[chosen]));
  EXPECT_EQ(frame.camera, world.Camera());
  // What the depth shows around the image's middle lies on or above the table of the world's frame.
  const auto point = rgbd::PointAt(frame, {frame.camera.cx, frame.camera.cy});
  ASSERT_TRUE(point.has_value());
  EXPECT_GT((*frame.T_world_camera * *point).z(), -0.01);
  ASSERT_EQ(world.Furniture().boxes.size(), 1u);
  EXPECT_NEAR(world.Furniture().boxes[0].T_world_box.translation().z() + world.Furniture().boxes[0].size_m.z() / 2, 0.0, 1e-12);
}

TEST(RecordedWorld, RecordingsThatCannotBeVisitedAreRefused) {
  const auto folder = std::filesystem::path(::testing::TempDir()) / ("recording_" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder / "rgb");
  cv::imwrite((folder / "rgb/000000.png").string(), cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(7)));
  std::ofstream(folder / "scene_camera.json") << R"({"0": {"cam_K": [50, 0, 32, 0, 50, 24, 0, 0, 1], "depth_scale": 1.0}})";
  const auto scene = std::make_shared<const rgbd::BopScene>(folder);
  EXPECT_THROW(RecordedWorld(scene, {0}), std::runtime_error);
  EXPECT_THROW(RecordedWorld(scene, {}), std::runtime_error);
  EXPECT_THROW(RecordedWorld(scene, {3}), std::runtime_error);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace vantage::simulation
