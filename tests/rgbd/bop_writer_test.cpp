#include "rgbd/bop_writer.h"

#include <gtest/gtest.h>

#include "rgbd/bop.h"
#include "support/folder.h"

namespace vantage::rgbd {
namespace {

Frame SmallFrame(bool with_depth) {
  Frame frame;
  frame.color.create(24, 32, CV_8UC3);
  cv::RNG random(5);
  random.fill(frame.color, cv::RNG::UNIFORM, 0, 255);
  if (with_depth) {
    frame.depth.create(24, 32, CV_16UC1);
    random.fill(frame.depth, cv::RNG::UNIFORM, 0, 5000);
  }
  frame.camera = {32, 24, 40.5, 41.25, 15.5, 11.5};
  return frame;
}

TEST(BopWriter, WhatIsWrittenIsRead) {
  const testing::TemporaryFolder folder;
  Frame frame = SmallFrame(true);
  BopWriter writer(folder / "scene");
  writer.Add(7, frame);
  frame.T_world_camera = geometry::LookAt({0.5, 0.2, 0.4}, {0.0, 0.0, 0.1}, Eigen::Vector3d::UnitZ());
  writer.Add(3, frame, EncodeColor(frame.color, 90));
  EXPECT_THROW(writer.Add(7, frame), std::invalid_argument);
  EXPECT_THROW(writer.Add(-1, frame), std::invalid_argument);
  writer.Finish();

  const BopScene scene(folder / "scene");
  EXPECT_EQ(scene.ids(), (std::vector<int>{3, 7}));
  const Frame seventh = scene.Load(7);
  EXPECT_EQ(cv::norm(seventh.color, frame.color, cv::NORM_INF), 0.0);
  EXPECT_EQ(cv::norm(seventh.depth, frame.depth, cv::NORM_INF), 0.0);
  EXPECT_EQ(seventh.camera, frame.camera);
  EXPECT_FALSE(seventh.T_world_camera);
  const Frame third = scene.Load(3);
  EXPECT_EQ(cv::norm(third.color, DecodeColor(EncodeColor(frame.color, 90)), cv::NORM_INF), 0.0);
  ASSERT_TRUE(third.T_world_camera);
  EXPECT_TRUE(third.T_world_camera->isApprox(*frame.T_world_camera, 1e-9));
  EXPECT_THROW(BopWriter(folder / "scene"), std::runtime_error);  // Nothing is written over.
}

TEST(BopWriter, FramesMayHaveNoDepth) {
  const testing::TemporaryFolder folder;
  BopWriter writer(folder / "scene");
  writer.Add(0, SmallFrame(false));
  writer.Finish();
  EXPECT_TRUE(BopScene(folder / "scene").Load(0).depth.empty());
}

}  // namespace
}  // namespace vantage::rgbd
