#include "messaging/frame_link.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <random>

#include "messaging/channels.h"

namespace vantage::messaging {
namespace {

rgbd::Frame NoiseFrame(int width, int height, std::int64_t utime, bool with_depth = true) {
  rgbd::Frame frame;
  frame.utime = utime;
  frame.id = utime + 100;
  cv::Mat gray(height, width, CV_8UC1);
  cv::RNG random(static_cast<std::uint64_t>(utime) + 1);
  random.fill(gray, cv::RNG::UNIFORM, 0, 255);  // Noise does not compress: large messages.
  cv::cvtColor(gray, frame.color, cv::COLOR_GRAY2BGR);
  if (with_depth) {
    frame.depth.create(height, width, CV_16UC1);
    random.fill(frame.depth, cv::RNG::UNIFORM, 0, 4000);
  }
  frame.camera.width = width;
  frame.camera.height = height;
  frame.camera.fx = frame.camera.fy = 500.0;
  frame.camera.cx = width / 2.0;
  frame.camera.cy = height / 2.0;
  frame.T_world_camera = geometry::Rigid::Identity();
  frame.T_world_camera->translation().z() = 0.5;
  return frame;
}

// Records the parts a sender publishes, so that a test can lose some.
struct Tap {
  explicit Tap(Bus& bus) {
    bus.Subscribe<image_part_t>(kSensorColor, [this](const image_part_t& part) { parts.emplace_back(kSensorColor, part); });
    bus.Subscribe<image_part_t>(kSensorDepth, [this](const image_part_t& part) { parts.emplace_back(kSensorDepth, part); });
  }
  std::vector<std::pair<std::string, image_part_t>> parts;
};

std::vector<std::pair<std::string, image_part_t>> PartsOf(const std::vector<rgbd::Frame>& frames) {
  Bus bus("memq://");
  Tap tap(bus);
  FrameSender sender(bus);
  for (const auto& frame : frames) sender.Send(frame);
  bus.Drain();
  return tap.parts;
}

TEST(FrameLink, AFrameArrivesWholeInPartsThatAreSmallEnough) {
  const auto frame = NoiseFrame(640, 480, 1000000);
  const auto parts = PartsOf({frame});
  EXPECT_GT(parts.size(), 4u);
  for (const auto& [channel, part] : parts) EXPECT_LE(part.getEncodedSize(), kMaxMessageBytes);

  Bus bus("memq://");
  FrameReceiver receiver(bus);
  FrameSender(bus).Send(frame);
  bus.Drain();
  const auto received = receiver.Take();
  ASSERT_TRUE(received) << receiver.last_error();
  EXPECT_EQ(received->frame.utime, frame.utime);
  EXPECT_EQ(received->frame.id, frame.id);
  EXPECT_EQ(received->frame.camera, frame.camera);
  EXPECT_EQ(cv::norm(received->frame.depth, frame.depth, cv::NORM_INF), 0.0);
  EXPECT_LT(cv::norm(received->frame.color, frame.color, cv::NORM_L1) / (640 * 480 * 3), 10.0);
  ASSERT_TRUE(received->frame.T_world_camera);
  EXPECT_TRUE(received->frame.T_world_camera->isApprox(*frame.T_world_camera));
  EXPECT_FALSE(receiver.Take());
  EXPECT_EQ(receiver.gaps(), 0);
}

TEST(FrameLink, RawFramesArriveAsTheyAre) {
  auto frame = NoiseFrame(64, 48, 1000000);
  Bus bus("memq://");
  FrameReceiver receiver(bus);
  Tap tap(bus);
  FrameSenderParams params;
  params.raw = true;
  params.max_part_bytes = 5000;
  FrameSender(bus, params).Send(frame);
  bus.Drain();
  const auto received = receiver.Take();
  ASSERT_TRUE(received) << receiver.last_error();
  EXPECT_EQ(cv::norm(received->frame.color, frame.color, cv::NORM_INF), 0.0);
  EXPECT_EQ(cv::norm(received->frame.depth, frame.depth, cv::NORM_INF), 0.0);
  EXPECT_TRUE(received->encoded_color.empty());

  image_part_t short_one = tap.parts[0].second;  // Fewer bytes than the image has.
  short_one.utime += 1000;
  short_one.parts = 1;
  short_one.total_size = short_one.size;
  short_one.with_depth = false;
  bus.Publish(kSensorColor, short_one);
  bus.Drain();
  EXPECT_FALSE(receiver.Take());
  EXPECT_NE(receiver.last_error().find("raw image"), std::string::npos) << receiver.last_error();
}

TEST(FrameLink, FramesWithoutDepthNeedNone) {
  Bus bus("memq://");
  FrameReceiver receiver(bus);
  FrameSender(bus).Send(NoiseFrame(64, 48, 1, false));
  bus.Drain();
  const auto received = receiver.Take();
  ASSERT_TRUE(received);
  EXPECT_TRUE(received->frame.depth.empty());
}

TEST(FrameLink, PartsMayComeInAnyOrder) {
  auto parts = PartsOf({NoiseFrame(640, 480, 1000000), NoiseFrame(640, 480, 1033333)});
  const unsigned seed = 3;
  SCOPED_TRACE(seed);
  std::shuffle(parts.begin(), parts.end() - static_cast<std::ptrdiff_t>(parts.size() / 2), std::mt19937(seed));
  Bus bus("memq://");
  FrameReceiver receiver(bus);
  for (const auto& [channel, part] : parts) bus.Publish(channel, part);
  bus.Drain();
  EXPECT_EQ(receiver.frames(), 2);
  EXPECT_EQ(receiver.skipped(), 1);  // Only the newest is kept.
  const auto received = receiver.Take();
  ASSERT_TRUE(received);
  EXPECT_EQ(received->frame.utime, 1033333);
  EXPECT_EQ(receiver.gaps(), 0);
}

TEST(FrameLink, ALostPartIsAGapNotAFrame) {
  std::vector<rgbd::Frame> frames;
  for (int i = 0; i < 6; ++i) frames.push_back(NoiseFrame(320, 240, 1000000 + 33333 * i));
  const auto parts = PartsOf(frames);
  Bus bus("memq://");
  FrameReceiver receiver(bus);
  for (const auto& [channel, part] : parts) {
    if (part.sequence == 2 && channel == kSensorDepth && part.part == 0) continue;
    if (part.sequence == 4 && channel == kSensorColor && part.part == part.parts - 1) continue;
    bus.Publish(channel, part);
  }
  bus.Drain();
  EXPECT_EQ(receiver.frames(), 4);
  EXPECT_EQ(receiver.gaps(), 2);
  EXPECT_EQ(receiver.Take()->sequence, 5);
}

TEST(FrameLink, ARestartedSourceIsNoGap) {
  Bus bus("memq://");
  FrameReceiver receiver(bus);
  FrameSender first(bus);
  for (int i = 0; i < 5; ++i) first.Send(NoiseFrame(32, 24, 1000000 + i));
  FrameSender second(bus);
  second.Send(NoiseFrame(32, 24, 3000000));
  bus.Drain();
  EXPECT_EQ(receiver.frames(), 6);
  EXPECT_EQ(receiver.gaps(), 0);
  EXPECT_EQ(receiver.Take()->sequence, 0);
}

TEST(FrameLink, AnOldLogPlayedAfterLiveFramesIsHeard) {
  Bus bus("memq://");
  FrameReceiver receiver(bus);
  FrameSender live(bus);
  for (int i = 0; i < 3; ++i) live.Send(NoiseFrame(32, 24, 1000000000 + i));
  FrameSender log(bus);
  for (int i = 0; i < 3; ++i) log.Send(NoiseFrame(32, 24, 5000 + i));
  bus.Drain();
  EXPECT_EQ(receiver.frames(), 6);
  EXPECT_EQ(receiver.Take()->frame.utime, 5002);
}

TEST(FrameLink, NonsenseIsRefusedAndTheNextFrameIsHeard) {
  const auto parts = PartsOf({NoiseFrame(64, 48, 1000)});
  const auto color = std::find_if(parts.begin(), parts.end(), [](const auto& p) { return p.first == kSensorColor; })->second;
  Bus bus("memq://");
  FrameReceiver receiver(bus);
  const auto publish = [&](auto change) {
    image_part_t bad = color;
    change(bad);
    bus.Publish(kSensorColor, bad);
  };
  publish([](image_part_t& p) { p.total_size = 2000000000; });
  publish([](image_part_t& p) { p.parts = -1; });
  publish([](image_part_t& p) { p.part = 7; });
  publish([](image_part_t& p) { p.encoding = image_part_t::DEPTH_RVL; });
  publish([](image_part_t& p) { p.utime = 0; });
  publish([](image_part_t& p) { p.total_size += 1; });
  bus.Drain();
  EXPECT_EQ(receiver.bad(), 6);

  // A size field that would make decoding allocate 2 GB.
  std::vector<unsigned char> bytes(color.getEncodedSize());
  color.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  const std::size_t size_at = bytes.size() - color.data.size() - 4;
  bytes[size_at] = 0x7f;
  bus.PublishRaw(kSensorColor, bytes.data(), bytes.size());
  bus.Drain();
  EXPECT_EQ(receiver.bad(), 7);

  // Headers that hold together around an image or a camera that does not.
  const auto take_bad = [&](std::int64_t utime, auto change) {
    image_part_t bad = color;
    bad.utime = utime;
    bad.with_depth = false;
    change(bad);
    bus.Publish(kSensorColor, bad);
    bus.Drain();
    EXPECT_TRUE(receiver.HasNew());
    EXPECT_FALSE(receiver.Take());
  };
  take_bad(2000, [](image_part_t& p) { p.data[0] = 0; });
  take_bad(3000, [](image_part_t& p) { p.camera.width = 65; });
  take_bad(4000, [](image_part_t& p) { p.camera.fx = std::nan(""); });
  take_bad(5000, [](image_part_t& p) { p.T_world_camera.position[0] = std::nan(""); });
  EXPECT_EQ(receiver.bad(), 11);

  FrameSender(bus).Send(NoiseFrame(64, 48, 6000));
  bus.Drain();
  EXPECT_TRUE(receiver.Take());
}

TEST(FrameLink, ParametersAreChecked) {
  Bus bus("memq://");
  FrameSenderParams params;
  params.jpeg_quality = 0;
  EXPECT_THROW(FrameSender(bus, params), std::invalid_argument);
  params = {};
  params.max_part_bytes = kMaxMessageBytes;
  EXPECT_THROW(FrameSender(bus, params), std::invalid_argument);
}

TEST(FrameLink, LossesAreCountedForEveryChannel) {
  std::vector<rgbd::Frame> frames;
  for (int i = 1; i <= 5; ++i) frames.push_back(NoiseFrame(64, 48, i * 1000));
  Bus bus("memq://");
  FrameReceiver receiver(bus);
  for (const auto& [channel, part] : PartsOf(frames)) {
    const bool lost =
        (channel == kSensorColor && part.sequence == 1) || (channel == kSensorDepth && part.sequence >= 1 && part.sequence <= 2);
    if (!lost) bus.Publish(channel, part);
  }
  bus.Drain();
  EXPECT_EQ(receiver.lost_colors(), 1);
  EXPECT_EQ(receiver.lost_depths(), 2);
  EXPECT_EQ(receiver.gaps(), 2);
  EXPECT_EQ(receiver.frames(), 3);
}

TEST(FrameLink, FramesThatNeverArriveWholeAreCountedAsTheyPass) {
  std::vector<rgbd::Frame> frames;
  for (int i = 1; i <= 5; ++i) frames.push_back(NoiseFrame(640, 480, i * 1000));
  Bus bus("memq://");
  FrameReceiver receiver(bus);
  for (const auto& [channel, part] : PartsOf(frames)) {
    if (channel == kSensorColor && part.part > 0) continue;
    bus.Publish(channel, part);
  }
  bus.Drain();
  EXPECT_EQ(receiver.frames(), 0);
  EXPECT_EQ(receiver.gaps(), 3);  // The first may have begun before we listened, the last may still come.
  EXPECT_EQ(receiver.lost_colors(), 3);
  EXPECT_EQ(receiver.lost_depths(), 0);
}

TEST(FrameLink, WhatClaimsToBeOfTheFutureDoesNotStopTheOthers) {
  Bus bus("memq://");
  FrameReceiver receiver(bus);
  const auto hostile = PartsOf({NoiseFrame(640, 480, 1)});
  for (int i = 0; i < 40; ++i) {  // Whole images without their other half, and halves of images.
    for (auto [channel, part] : hostile) {
      if (i % 2 == 0 && (channel == kSensorDepth || part.part > 0)) continue;
      if (i % 2 == 1 && channel == kSensorDepth) continue;
      part.utime = 4000000000000000000 + i;
      bus.Publish(channel, part);
    }
  }
  bus.Drain();
  for (int i = 1; i <= 3; ++i) FrameSender(bus).Send(NoiseFrame(640, 480, i * 1000));
  bus.Drain();
  EXPECT_EQ(receiver.frames(), 3);
  EXPECT_TRUE(receiver.Take());
}

TEST(FrameLink, PartsThatMakeMoreThanTheirImageAreRefused) {
  auto parts = PartsOf({NoiseFrame(640, 480, 1)});
  Bus bus("memq://");
  FrameReceiver receiver(bus);
  for (int i = 0; i < 20; ++i) {
    auto [channel, part] = parts[0];
    part.parts = 30000;
    part.part = static_cast<std::int16_t>(i);
    part.total_size = part.size * 2;
    bus.Publish(channel, part);
  }
  bus.Drain();
  EXPECT_GE(receiver.bad_colors(), 6);
  EXPECT_EQ(receiver.bad_depths(), 0);
}

}  // namespace
}  // namespace vantage::messaging
