// The OpenNI2 source and the sensor on a camera of our own (driver/test_camera.cpp), with everything that happens to cameras.
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <thread>
#include <vantage/status_t.hpp>

#include "messaging/channels.h"
#include "messaging/run_loop.h"
#include "openni/test_views.h"
#include "rgbd/openni/openni_source.h"
#include "sensor/node.h"

namespace vantage::rgbd {
namespace {

using testing::InChild;
using Seconds = std::chrono::duration<double>;

const testing::TestCamera& Camera() {
  static const testing::TestCamera camera;
  return camera;
}

OpenNiParams Params() {
  OpenNiParams params;
  params.timeout_ms = 500;
  return params;
}

std::string Complaint(const OpenNiParams& params) {
  try {
    OpenNiSource source(params);
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

void ExpectWords(const std::string& text, const std::vector<std::string>& words) {
  for (const auto& word : words) EXPECT_NE(text.find(word), std::string::npos) << "no '" << word << "' in: " << text;
  EXPECT_EQ(text.find('\n'), std::string::npos) << text;
}

class OpenNiDevice : public ::testing::Test {
 protected:
  void SetUp() override { Camera().Command(""); }
};

TEST_F(OpenNiDevice, ShowsItsViewsAsTheyAre) {
  InChild([] {
    OpenNiSource source(Params());
    EXPECT_EQ(source.uri(), "test/camera@1");
    EXPECT_FALSE(source.is_recording());
    EXPECT_TRUE(source.registered());
    EXPECT_TRUE(source.in_step());
    ExpectWords(source.modes(), {"colour 640x480 RGB888 at 30 Hz", "depth 640x480 1 mm at 30 Hz", "registered", "in step"});
    EXPECT_NEAR(source.camera().fx, 320.0 / std::tan(0.5), 1e-3);
    EXPECT_NEAR(source.camera().fy, 240.0 / std::tan(0.4), 1e-3);
    std::int64_t previous = 0;
    for (int i = 0; i < 10; ++i) {
      const auto frame = source.Next();
      ASSERT_TRUE(frame);
      EXPECT_NO_THROW(CheckFrame(*frame));
      const int view = Camera().ViewOf(frame->color);
      ASSERT_GE(view, 0) << "turned back as it was mirrored, and colours in order";
      EXPECT_EQ(cv::norm(Camera().views()[static_cast<std::size_t>(view)].depth, frame->depth, cv::NORM_INF), 0.0);
      EXPECT_EQ(frame->id, i);
      if (previous > 0) {
        EXPECT_GE(frame->utime - previous, 33000);
      }
      previous = frame->utime;
    }
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    EXPECT_LT(std::abs(std::chrono::duration_cast<std::chrono::microseconds>(now).count() - previous), 1000000);
  });
}

TEST_F(OpenNiDevice, SaysWhereItCanNeitherRegisterNorKeepInStep) {
  Camera().Command("registration 0\nsync 0\n");
  InChild([] {
    OpenNiSource source(Params());
    EXPECT_FALSE(source.registered());
    EXPECT_EQ(source.modes().find("registered"), std::string::npos) << source.modes();
    for (int i = 0; i < 5; ++i) {
      const auto frame = source.Next();
      ASSERT_TRUE(frame);
      const int view = Camera().ViewOf(frame->color);
      ASSERT_GE(view, 0);
      const cv::Mat& depth = Camera().views()[static_cast<std::size_t>(view)].depth;
      EXPECT_EQ(cv::norm(depth.colRange(0, 600), frame->depth.colRange(12, 612), cv::NORM_INF), 0.0)
          << "paired by time, not registered";
    }
  });
}

TEST_F(OpenNiDevice, PairsWhatIsLeftWhereImagesAreLost) {
  Camera().Command("drop_color 3\ndrop_depth 4\n");
  InChild([] {
    OpenNiSource source(Params());
    for (int i = 0; i < 20; ++i) {
      const auto frame = source.Next();
      ASSERT_TRUE(frame);
      const int view = Camera().ViewOf(frame->color);
      ASSERT_GE(view, 0);
      EXPECT_EQ(cv::norm(Camera().views()[static_cast<std::size_t>(view)].depth, frame->depth, cv::NORM_INF), 0.0);
    }
  });
}

TEST_F(OpenNiDevice, TakesTheModeThatIsWantedOrNamesThoseThereAre) {
  InChild([] {
    OpenNiParams params = Params();
    params.width = 320;
    params.height = 240;
    params.fps = 30;
    {
      OpenNiSource source(params);
      ExpectWords(source.modes(), {"colour 320x240", "depth 320x240"});
      EXPECT_EQ(source.Next()->color.size(), cv::Size(320, 240));
    }
    params.width = 1280;
    params.height = 720;
    ExpectWords(Complaint(params), {"test/camera@1", "1280x720 at 30 Hz", "640x480 RGB888 at 30 Hz", "320x240 RGB888 at 30 Hz"});
    params.width = params.height = 0;
    params.fps = 60;
    ExpectWords(Complaint(params), {"at 60 Hz", "640x480 RGB888 at 30 Hz"});
    params.height = 480;
    ExpectWords(Complaint(params), {"width and height"});
  });
}

TEST_F(OpenNiDevice, SaysWhyItCannotBeOpened) {
  InChild([] {
    OpenNiParams params = Params();
    params.uri = "test/other@1";
    ExpectWords(Complaint(params), {"test/other@1", "found test/camera@1"});
    Camera().Command("openable 0\n");
    ExpectWords(Complaint(Params()), {"test/camera@1", "cannot be opened", "access denied", "may this user open it"});
    Camera().Command("plugged 0\n");
    ExpectWords(Complaint(Params()), {"OpenNI2 device", "found none", "plugged in"});
    Camera().Command("field_of_view 0\n");
    ExpectWords(Complaint(Params()), {"field of view", "vantage calibrate"});
  });
}

TEST_F(OpenNiDevice, GoesOnAfterASilence) {
  InChild([] {
    OpenNiSource source(Params());
    const std::int64_t before = source.Next()->utime;
    Camera().Command("stalled 1\n");
    std::string complaint;
    try {
      for (int i = 0; i < 30; ++i) source.Next();
    } catch (const std::exception& error) {
      complaint = error.what();
    }
    ExpectWords(complaint, {"within 500 ms", "silent"});
    Camera().Command("");
    const auto frame = source.Next();
    ASSERT_TRUE(frame);
    EXPECT_GT(frame->utime, before + 400000) << "the silence is in the time of capture";
  });
}

TEST_F(OpenNiDevice, IsGoneWhenUnpluggedAndFoundAtAnotherPort) {
  InChild([] {
    OpenNiParams params = Params();
    params.uri = "test/camera@1";
    {
      OpenNiSource source(params);
      ASSERT_TRUE(source.Next());
      Camera().Command("plugged 0\n");
      const auto begin = std::chrono::steady_clock::now();
      EXPECT_THROW(
          {
            for (int i = 0; i < 30; ++i) source.Next();
          },
          DeviceGone);
      EXPECT_LT(Seconds(std::chrono::steady_clock::now() - begin).count(), 1.0);
      EXPECT_THROW(source.Next(), DeviceGone) << "and stays so";
    }
    Camera().Command("address 2\n");
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    ExpectWords(Complaint(params), {"test/camera@1", "found test/camera@2"});
    params.elsewhere = true;
    OpenNiSource source(params);
    EXPECT_EQ(source.uri(), "test/camera@2");
    EXPECT_TRUE(source.Next());
  });
}

TEST_F(OpenNiDevice, TakesDistortionOutOnce) {
  InChild([] {
    Camera().Command("field_of_view 0\n");
    OpenNiParams params = Params();
    params.calibration = CameraCalibration{{640, 480, 530, 531, 318, 242}, {-0.2, 0.05, 0.001, -0.002, 0.0}};
    auto source = std::make_unique<OpenNiSource>(params);
    const Undistorter undistorter(*params.calibration);
    std::vector<cv::Mat> expected;
    for (Frame view : Camera().views()) {
      undistorter.Undistort(view);
      expected.push_back(view.color);
    }
    for (int i = 0; i < 3; ++i) {
      const auto frame = source->Next();
      ASSERT_TRUE(frame);
      EXPECT_EQ(frame->camera, params.calibration->camera);
      EXPECT_EQ(std::count_if(expected.begin(), expected.end(),
                              [&](const cv::Mat& image) { return cv::norm(image, frame->color, cv::NORM_INF) == 0.0; }),
                1);
    }
    source.reset();
    params.calibration->camera.width = 320;
    ExpectWords(Complaint(params), {"expected colour of 320x480 as calibrated", "640x480"});
  });
}

TEST_F(OpenNiDevice, RecordsWhatPlaysBack) {
  for (const bool lossless : {true, false}) {
    InChild([lossless] {
      OpenNiParams params = Params();
      params.record = (Camera().folder() / (lossless ? "lossless.oni" : "jpeg.oni")).string();
      params.record_lossless = lossless;
      int seen = 0;
      {
        OpenNiSource source(params);
        while (seen < 15) seen += source.Next().has_value();
      }
      EXPECT_NE(Complaint(params).find("name another"), std::string::npos) << "a recording is never written over";
      OpenNiParams play;
      play.uri = params.record;
      OpenNiSource source(play);
      EXPECT_GE(source.recorded_frames(), 15);
      EXPECT_NEAR(source.camera().fx, 320.0 / std::tan(0.5), 1e-3) << "its field of view is kept";
      int played = 0;
      std::int64_t previous = -1;
      while (const auto frame = source.Next()) {
        ++played;
        EXPECT_GT(frame->utime, previous);
        previous = frame->utime;
        std::size_t best = 0;
        double best_error = 1e9;
        for (std::size_t i = 0; i < Camera().views().size(); ++i) {
          const double error = cv::norm(Camera().views()[i].color, frame->color, cv::NORM_L1) / (640.0 * 480.0 * 3.0);
          if (error < best_error) best = i;
          best_error = std::min(best_error, error);
        }
        EXPECT_LE(best_error, lossless ? 0.0 : 4.0) << "grey levels";
        EXPECT_EQ(cv::norm(Camera().views()[best].depth, frame->depth, cv::NORM_INF), 0.0);
      }
      EXPECT_GE(played, 15);
    });
  }
}

// The whole sensor, with what it says and sends.
class RunningSensor {
 public:
  explicit RunningSensor(const sensor::OpenNiOptions& options)
      : receiver(bus_), node_(bus_, sensor::MakeOpenNiSource(options), Fast()) {
    bus_.Subscribe<status_t>(messaging::StatusChannel("sensor"), [this](const status_t& status) { told.push_back(status); });
  }

  // Ends sooner where `until` becomes true; whether it did.
  bool RunFor(
      double seconds, const std::function<bool()>& until = [] { return false; }) {
    const auto end = std::chrono::steady_clock::now() + Seconds(seconds);
    bool reached = false;
    messaging::RunParams run;
    run.status_period_s = 0.1;
    run.until = [&] { return (reached = until()) || std::chrono::steady_clock::now() > end; };
    EXPECT_EQ(messaging::RunNodes(bus_, {&node_}, nullptr, run), messaging::RunEnd::kCondition);
    return reached;
  }
  bool Said(const std::string& words) const {
    return std::any_of(told.begin(), told.end(),
                       [&](const status_t& status) { return status.last_error.find(words) != std::string::npos; });
  }

 private:
  static sensor::SensorNodeParams Fast() {
    sensor::SensorNodeParams params;
    params.rate_hz = 30.0;
    return params;
  }
  messaging::Bus bus_{"memq://"};

 public:
  messaging::FrameReceiver receiver;
  std::vector<status_t> told;

 private:
  sensor::SensorNode node_;
};

// While its camera is pulled out and put back elsewhere.
TEST_F(OpenNiDevice, TheSensorSurvivesUnplugAndReplug) {
  InChild([] {
    sensor::OpenNiOptions options;
    options.uri = "test/camera@1";
    RunningSensor sensor(options);
    sensor.RunFor(1.0);
    EXPECT_GT(sensor.receiver.frames(), 20);
    EXPECT_EQ(sensor.told.back().state, "streaming");
    ExpectWords(sensor.told.back().detail, {"test/camera@1", "640x480 RGB888"});
    Camera().Command("plugged 0\n");
    sensor.RunFor(2.5);
    const auto before = sensor.receiver.frames();
    EXPECT_EQ(sensor.told.back().state, "waiting");
    EXPECT_TRUE(sensor.Said("unplugged"));
    ExpectWords(sensor.told.back().last_error, {"found none"});
    sensor.RunFor(0.5);
    EXPECT_EQ(sensor.receiver.frames(), before);
    Camera().Command("address 7\n");
    sensor.RunFor(2.5);
    EXPECT_GT(sensor.receiver.frames(), before + 20);
    EXPECT_EQ(sensor.told.back().state, "streaming");
    ExpectWords(sensor.told.back().detail, {"test/camera@7"});
    const auto received = sensor.receiver.Take();
    ASSERT_TRUE(received);
    EXPECT_GT(received->frame.id, before - 1) << "frame numbers go on";
  });
}

// A camera whose firmware hangs sends nothing more, though it is plugged in: only opening it anew helps.
TEST_F(OpenNiDevice, TheSensorReopensACameraThatHangs) {
  EXPECT_EQ(sensor::OpenNiOptions().max_silence_s, 3.0) << "as the README says";
  InChild([] {
    sensor::OpenNiOptions options;
    options.max_silence_s = 1.0;
    options.record = (Camera().folder() / "hangs.oni").string();
    RunningSensor sensor(options);
    auto& receiver = sensor.receiver;
    EXPECT_TRUE(sensor.RunFor(10.0, [&] { return receiver.frames() > 10; }));
    Camera().Command("hung 1\n");
    sensor.RunFor(0.2);
    const auto before = receiver.frames();
    const auto since = std::chrono::steady_clock::now();
    EXPECT_TRUE(sensor.RunFor(10.0, [&] { return receiver.frames() > before + 10; })) << sensor.told.back().last_error;
    EXPECT_GT(Seconds(std::chrono::steady_clock::now() - since).count(), 1.0) << "as long as it may be silent, and a look";
    EXPECT_TRUE(sensor.Said("silent")) << sensor.told.back().last_error;
    EXPECT_TRUE(std::any_of(sensor.told.begin(), sensor.told.end(), [](const auto& status) { return status.state == "waiting"; }));
    sensor.RunFor(0.2);
    EXPECT_EQ(sensor.told.back().state, "streaming");
    const auto received = receiver.Take();
    ASSERT_TRUE(received);
    EXPECT_GE(received->frame.id, before + 10) << "frame numbers go on";
    EXPECT_TRUE(std::filesystem::exists(Camera().folder() / "hangs-2.oni")) << "the recording goes on in a new file";
  });
}

// Silent however often it is opened: it is tried again and again, and taken up when it comes back.
TEST_F(OpenNiDevice, TheSensorNeverGivesUpOnASilentCamera) {
  for (const bool recorded : {false, true}) {
    SCOPED_TRACE(recorded ? "recorded" : "not recorded");
    Camera().Command("");
    InChild([recorded] {
      sensor::OpenNiOptions options;
      options.max_silence_s = 0.3;
      if (recorded) options.record = (Camera().folder() / "silent.oni").string();
      RunningSensor sensor(options);
      auto& receiver = sensor.receiver;
      EXPECT_TRUE(sensor.RunFor(10.0, [&] { return receiver.frames() > 5; }));
      Camera().Command("stalled 1\n");
      sensor.RunFor(0.2);
      const auto before = receiver.frames();
      const auto told = sensor.told.size();
      sensor.RunFor(5.0);  // Opened anew three times or so.
      EXPECT_EQ(receiver.frames(), before);
      EXPECT_GT(sensor.told.size(), told + 5) << "it goes on to say how it fares";
      EXPECT_NE(sensor.told.back().last_error.find("silent"), std::string::npos) << sensor.told.back().last_error;
      EXPECT_FALSE(std::filesystem::exists(Camera().folder() / "silent-2.oni")) << "no recording of nothing is left";
      Camera().Command("");
      EXPECT_TRUE(sensor.RunFor(10.0, [&] { return receiver.frames() > before + 10; })) << sensor.told.back().last_error;
      EXPECT_EQ(std::filesystem::exists(Camera().folder() / "silent-2.oni"), recorded);
    });
  }
}

TEST_F(OpenNiDevice, TheSensorProgramRecordsUntilItIsEnded) {
  constexpr std::uintmax_t kBytes = 3000000;  // Some twenty frames.
  const std::string file = (Camera().folder() / "program.oni").string();
  std::fflush(nullptr);
  const pid_t sensor = fork();
  ASSERT_GE(sensor, 0);
  if (sensor == 0) {
    ::setenv("LD_LIBRARY_PATH", VANTAGE_OPENNI2_HOST, 1);
    ::execl(VANTAGE_SENSOR, "sensor", "--url", "memq://", "--oni", "any", "--mode", "320x240@30", "--record", file.c_str(),
            nullptr);
    _exit(127);
  }
  // A busy machine takes seconds to start it, and has its own pace: what counts is that frames come to the disk, not how soon.
  const auto patience = std::chrono::steady_clock::now() + Seconds(30.0);
  std::error_code none;
  const auto bytes = [&] { return std::filesystem::exists(file, none) ? std::filesystem::file_size(file, none) : 0; };
  while (bytes() < kBytes && std::chrono::steady_clock::now() < patience) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  ::kill(sensor, SIGTERM);
  int status = 0;
  pid_t ended = 0;
  const auto end = std::chrono::steady_clock::now() + Seconds(30.0);
  while ((ended = waitpid(sensor, &status, WNOHANG)) == 0 && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  if (ended == 0) {
    ::kill(sensor, SIGKILL);
    waitpid(sensor, &status, 0);
  }
  ASSERT_EQ(ended, sensor) << "it does not end";
  ASSERT_EQ(status, 0);
  InChild([&] {
    OpenNiParams play;
    play.uri = file;
    OpenNiSource source(play);
    int played = 0;
    while (const auto frame = source.Next()) played += frame->color.size() == cv::Size(320, 240);
    EXPECT_GT(played, 15);
  });
}

}  // namespace
}  // namespace vantage::rgbd
