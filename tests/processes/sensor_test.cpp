#include <gtest/gtest.h>

#include "messaging/channels.h"
#include "messaging/run_loop.h"
#include "sensor/node.h"
#include "support/data.h"

namespace vantage::sensor {
namespace {

TEST(Sensor, PlaysARecordingToItsEnd) {
  VANTAGE_NEEDS_DATA("ycbv");
  messaging::Bus bus("memq://");
  messaging::FrameReceiver receiver(bus);
  SensorNodeParams params;
  params.rate_hz = 100.0;
  SensorNode node(bus, MakeRecordingSource(testing::DataFolder() / "ycbv", "all", false), params);
  std::vector<rgbd::Frame> frames;
  messaging::RunParams run;
  run.until = [&] {
    if (auto received = receiver.Take()) frames.push_back(std::move(received->frame));
    return false;
  };
  EXPECT_EQ(messaging::RunNodes(bus, {&node}, nullptr, run), messaging::RunEnd::kFinished);
  bus.Drain();
  run.until();
  const rgbd::BopScene scene(testing::DataFolder() / "ycbv");
  EXPECT_EQ(static_cast<std::size_t>(node.frames()), scene.ids().size());
  ASSERT_FALSE(frames.empty());
  const rgbd::Frame original = scene.Load(static_cast<int>(frames.back().id));
  EXPECT_EQ(cv::norm(frames.back().depth, original.depth, cv::NORM_INF), 0.0);
  ASSERT_TRUE(frames.back().T_world_camera);
  EXPECT_TRUE(frames.back().T_world_camera->isApprox(*original.T_world_camera, 1e-9));
  EXPECT_GT(frames.back().utime, 1000000000000000);  // Now, not the recording's count.
  EXPECT_EQ(receiver.gaps(), 0);
}

TEST(Sensor, PlaysAnOpenNiRecording) {
  VANTAGE_NEEDS_DATA("oni/kinect_12_frames.oni");
  messaging::Bus bus("memq://");
  messaging::FrameReceiver receiver(bus);
  SensorNodeParams params;
  params.rate_hz = 100.0;
  OpenNiOptions options;
  options.uri = (testing::DataFolder() / "oni" / "kinect_12_frames.oni").string();
  SensorNode node(bus, MakeOpenNiSource(options), params);
  EXPECT_EQ(messaging::RunNodes(bus, {&node}, nullptr), messaging::RunEnd::kFinished);
  bus.Drain();
  EXPECT_GE(receiver.frames(), 10);
  EXPECT_EQ(receiver.gaps(), 0);
  const auto received = receiver.Take();
  ASSERT_TRUE(received) << receiver.last_error();
  EXPECT_EQ(received->frame.camera.width, 640);
  EXPECT_GT(cv::countNonZero(received->frame.depth), 640 * 480 / 10);
}

TEST(Sensor, SourcesThatAreNotThereSaySo) {
  EXPECT_THROW(MakeRecordingSource("/no/such/folder", "all", false), std::runtime_error);
  try {
    OpenNiOptions options;
    options.uri = "/no/such/file.oni";
    MakeOpenNiSource(options);
    FAIL() << "accepted";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("/no/such/file.oni"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace vantage::sensor
