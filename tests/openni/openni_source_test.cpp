#include "rgbd/openni/openni_source.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <opencv2/core.hpp>

#include "support/data.h"
#include "support/temp_folder.h"

namespace vantage::rgbd {
namespace {

std::string Recording() { return (testing::DataFolder() / "oni/kinect_12_frames.oni").string(); }

OpenNiParams Params(const std::string& uri) {
  OpenNiParams params;
  params.uri = uri;
  return params;
}

// What opening complains about; empty where it does not.
std::string Complaint(const OpenNiParams& params) {
  try {
    OpenNiSource source(params);
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

TEST(OpenNiRecording, GivesItsTwelveFramesAndEnds) {
  VANTAGE_NEEDS_DATA("oni");
  OpenNiParams params = Params(Recording());
  params.start_utime = 1000000;
  OpenNiSource source(params);
  EXPECT_TRUE(source.is_recording());
  EXPECT_EQ(source.recorded_frames(), 12);
  std::int64_t previous = 0;
  for (int i = 0; i < 12; ++i) {
    const std::optional<Frame> frame = source.Next();
    ASSERT_TRUE(frame) << "frame " << i;
    EXPECT_NO_THROW(CheckFrame(*frame));
    EXPECT_EQ(frame->id, i);
    EXPECT_NEAR(static_cast<double>(frame->utime), 1e6 + i * 33338.0, 20.0);
    EXPECT_GT(frame->utime, previous);
    previous = frame->utime;
    EXPECT_EQ(frame->depth.size(), cv::Size(640, 480));
    EXPECT_GT(cv::countNonZero(frame->depth), 100000);
    EXPECT_GT(cv::mean(frame->color)[1], 20.0);
  }
  EXPECT_FALSE(source.Next());
  EXPECT_FALSE(source.Next()) << "and stays at its end";
}

TEST(OpenNiRecording, TakesTheDepthStreamsFieldOfViewWhereColourSaysNone) {
  VANTAGE_NEEDS_DATA("oni");
  const OpenNiSource source(Params(Recording()));
  EXPECT_NEAR(source.camera().fx, 575.0, 2.0);  // A Kinect's depth camera.
  EXPECT_NEAR(source.camera().fy, 575.0, 2.0);
  EXPECT_DOUBLE_EQ(source.camera().cx, 319.5);
  OpenNiParams params = Params(Recording());
  params.calibration = CameraCalibration{{640, 480, 525, 525, 320, 240}, {}};
  EXPECT_EQ(OpenNiSource(params).Next()->camera, params.calibration->camera);
  params.calibration->camera.width = 320;
  EXPECT_NE(Complaint(params).find("320x480"), std::string::npos) << Complaint(params);
}

TEST(OpenNiRecording, IsTheSameOnEveryRun) {
  VANTAGE_NEEDS_DATA("oni");
  OpenNiSource first(Params(Recording())), second(Params(Recording()));
  while (const std::optional<Frame> a = first.Next()) {
    const std::optional<Frame> b = second.Next();
    ASSERT_TRUE(b);
    EXPECT_EQ(a->utime, b->utime);
    EXPECT_EQ(cv::norm(a->color, b->color, cv::NORM_INF), 0.0);
    EXPECT_EQ(cv::norm(a->depth, b->depth, cv::NORM_INF), 0.0);
  }
}

TEST(OpenNiRecording, RepeatsWithTimesAndNumbersThatGoOn) {
  VANTAGE_NEEDS_DATA("oni");
  OpenNiParams params = Params(Recording());
  params.repeat = true;
  OpenNiSource source(params);
  cv::Mat first;
  std::int64_t previous = -1;
  for (int i = 0; i < 30; ++i) {
    const std::optional<Frame> frame = source.Next();
    ASSERT_TRUE(frame) << "frame " << i;
    EXPECT_EQ(frame->id, i);
    EXPECT_GT(frame->utime, previous) << "frame " << i;
    EXPECT_LT(frame->utime - previous, 100000) << "frame " << i;
    previous = frame->utime;
    if (i == 0) first = frame->color;
    if (i == 12 || i == 24) {
      EXPECT_EQ(cv::norm(first, frame->color, cv::NORM_INF), 0.0) << "frame " << i;
    }
  }
}

TEST(OpenNiRecording, KeepsItsOwnTimeWhereAsked) {
  VANTAGE_NEEDS_DATA("oni");
  OpenNiParams params = Params(Recording());
  params.speed = 2.0;
  OpenNiSource source(params);
  const auto start = std::chrono::steady_clock::now();
  while (source.Next()) continue;
  const double passed_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  EXPECT_GE(passed_s, 0.5 * 11 * 0.03333);
  EXPECT_LT(passed_s, 5.0);
}

TEST(OpenNi, WhatCannotBeOpenedIsNamedOnOneLine) {
  testing::TempFolder folder;
  folder.Write("broken.oni", "this is no recording");
  for (const std::string& uri : {(folder / "none.oni").string(), (folder / "broken.oni").string(), std::string("no such device")}) {
    const std::string complaint = Complaint(Params(uri));
    EXPECT_EQ(complaint.find(uri), 0u) << complaint;
    EXPECT_NE(complaint.find("expected"), std::string::npos) << complaint;
    EXPECT_EQ(complaint.find('\n'), std::string::npos) << complaint;
  }
}

TEST(OpenNi, CheckNamesTheField) {
  OpenNiParams params;
  params.speed = -1.0;
  EXPECT_NE(Complaint(params).find("speed"), std::string::npos) << Complaint(params);
  params = {};
  params.timeout_ms = 0;
  EXPECT_NE(Complaint(params).find("timeout_ms"), std::string::npos) << Complaint(params);
}

// The library's own dummy driver is a live device without a camera. It crashes when OpenNI shuts down after a stream ran, so it
// gets a process of its own that leaves without cleaning up. Exit code: frames read, or 100 where something threw.
TEST(OpenNi, ALiveDeviceStreamsFramesOfNow) {
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    int frames = 0;
    try {
      OpenNiParams params = Params("Dummy");
      params.calibration = CameraCalibration{{320, 240, 290, 290, 159.5, 119.5}, {}};
      auto* source = new OpenNiSource(params);
      const auto now = std::chrono::system_clock::now().time_since_epoch();
      const std::int64_t now_us = std::chrono::duration_cast<std::chrono::microseconds>(now).count();
      for (int i = 0; i < 5; ++i) {
        const std::optional<Frame> frame = source->Next();
        if (frame && !source->is_recording() && std::abs(frame->utime - now_us) < 5000000) ++frames;
      }
    } catch (const std::exception& error) {
      fprintf(stderr, "%s\n", error.what());
      _exit(100);
    }
    _exit(frames);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 5);
}

}  // namespace
}  // namespace vantage::rgbd
