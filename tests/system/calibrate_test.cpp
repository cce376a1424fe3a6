// vantage calibrate and vantage truth, on pictures of a board made here and on real ones.
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "calibration/render_board.h"
#include "common/calibration_file.h"
#include "messaging/channels.h"
#include "messaging/frame_link.h"
#include "messaging/log.h"
#include "messaging/mount_messages.h"
#include "support/data.h"
#include "support/temp_folder.h"

namespace vantage {
namespace {

constexpr char kBoardYaml[] = "kind: tag_grid\ndictionary: 36h11\ncolumns: 5\nrows: 4\ntag_mm: 40\ngap_mm: 12\nfirst_id: 3\n";

struct Output {
  int code = 0;
  std::string text;
  nlohmann::json json;
};

class Calibrate : public ::testing::Test {
 protected:
  Calibrate() : board_(calibration::TagGrid("36h11", 5, 4, 0.04, 0.012, 3)), paper_(testing::PrintBoard(board_)) {
    folder_.Write("board.yaml", kBoardYaml);
  }

  Output Run(const std::string& arguments) {
    const std::string json = (folder_ / "result.json").string(), text = (folder_ / "text").string();
    const std::string command = std::string(VANTAGE_PROGRAM) + " " + arguments + " --json " + json + " > " + text + " 2>&1";
    Output output;
    output.code = std::system(command.c_str());
    std::ifstream stream(text);
    output.text.assign(std::istreambuf_iterator<char>(stream), {});
    std::ifstream result(json);
    if (result) output.json = nlohmann::json::parse(result, nullptr, false);
    return output;
  }
  std::string File(const std::string& name) const { return (folder_ / name).string(); }

  testing::TempFolder folder_;
  calibration::Board board_;
  cv::Mat paper_;
  const Eigen::Vector3d middle_{0.124, 0.098, 0.0};
};

TEST_F(Calibrate, IntrinsicsFromImagesAsYamlAndPicture) {
  const rgbd::CameraCalibration lens{{640, 480, 530.0, 528.0, 325.0, 236.0}, {-0.18, 0.06, 0.001, -0.0015, 0.0}};
  folder_.Write("images/readme.txt", "not an image");
  for (int i = 0; i < 14; ++i) {
    cv::imwrite(File("images/" + std::to_string(i) + ".png"),
                testing::PhotographBoard(paper_, lens, testing::BoardPoseOf(i, middle_), i));
  }
  const auto output = Run("calibrate --board " + File("board.yaml") + " --images " + File("images") + " --out " +
                          File("camera.yaml") + " --picture " + File("coverage.png"));
  ASSERT_EQ(output.code, 0) << output.text;
  EXPECT_NE(output.text.find("reprojection error"), std::string::npos) << output.text;
  const auto file = processes::LoadCalibration(File("camera.yaml"));
  EXPECT_NEAR(file.calibration.camera.fx, 530.0, 3.0);
  EXPECT_NEAR(file.calibration.camera.cx, 325.0, 3.0);
  EXPECT_NEAR(file.calibration.distortion[0], -0.18, 0.03);
  EXPECT_LT(file.rms_px, 0.5);
  EXPECT_EQ(file.images, output.json["views"].get<int>());
  EXPECT_EQ(cv::imread(File("coverage.png")).size(), cv::Size(640, 480));
  if (const char* keep = std::getenv("VANTAGE_KEEP_PICTURES")) {
    std::filesystem::copy_file(File("coverage.png"), std::string(keep) + "/coverage.png",
                               std::filesystem::copy_options::overwrite_existing);
    std::filesystem::copy_file(File("images/3.png"), std::string(keep) + "/board.png",
                               std::filesystem::copy_options::overwrite_existing);
  }
}

TEST_F(Calibrate, HandEyeFromALog) {
  geometry::Rigid T_mount_camera = geometry::Rigid::Identity();
  T_mount_camera.linear() = Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, 2, -1).normalized()).toRotationMatrix();
  T_mount_camera.translation() = Eigen::Vector3d(0.02, -0.06, 0.09);
  const rgbd::CameraCalibration lens{{640, 480, 530.0, 530.0, 319.5, 239.5}, {}};
  {
    messaging::LogWriter log(File("log.lcm"));
    std::int64_t now_us = 1700000000000000;
    messaging::Bus bus("memq://", [&] { return now_us; });
    bus.SetTap([&](const std::string& channel, const void* data, std::size_t size) { log.Write(now_us, channel, data, size); });
    messaging::FrameSender sender(bus);
    for (int pose = 0; pose < 10; ++pose) {
      const auto T_camera_board = testing::BoardPoseOf(pose, middle_);
      rgbd::Frame frame;
      frame.color = testing::PhotographBoard(paper_, lens, T_camera_board, pose);
      frame.camera = lens.camera;
      for (int look = 0; look < 2; ++look) {  // One alone may be moving.
        messaging::MountState state;
        state.T_world_mount = (T_mount_camera * T_camera_board).inverse();
        state.utime = now_us;
        bus.Publish(messaging::kMountState, messaging::ToMessage(state));
        frame.id = 2 * pose + look;
        frame.utime = now_us;
        sender.Send(frame);
        now_us += 100000;
      }
    }
    log.Close();
  }
  const auto output =
      Run("calibrate --hand-eye --board " + File("board.yaml") + " --log " + File("log.lcm") + " --out " + File("hand.yaml"));
  ASSERT_EQ(output.code, 0) << output.text;
  geometry::Rigid found;
  for (int i = 0; i < 16; ++i) found(i / 4, i % 4) = output.json["T_mount_camera"][static_cast<std::size_t>(i)].get<double>();
  EXPECT_LT(geometry::Difference(found, T_mount_camera).translation_m, 0.002);
  EXPECT_LT(geometry::Difference(found, T_mount_camera).rotation_rad, 0.003);
  EXPECT_EQ(output.json["views"], 10);
  EXPECT_LT(output.json["position_mm"].get<double>(), 1.5);
  const auto file = processes::LoadHandEye(File("hand.yaml"));
  EXPECT_TRUE(file.T_mount_camera.isApprox(found, 1e-6)) << "as the mount reads it";
  EXPECT_EQ(file.views, 10);
}

TEST_F(Calibrate, WhatIsWrongIsSaidInOneLine) {
  folder_.Write("square.yaml", "kind: checkerboard\ncolumns: 6\nrows: 6\n");
  folder_.Write("typo.yaml", "kind: checkerboard\ncolums: 6\n");
  folder_.Write("empty/readme.txt", "");
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"--board " + File("none.yaml") + " --images " + File("empty"), "none.yaml"},
      {"--board " + File("square.yaml") + " --images " + File("empty"), "must differ"},
      {"--board " + File("typo.yaml") + " --images " + File("empty"), "colums"},
      {"--board " + File("board.yaml") + " --images " + File("empty"), "no images"},
      {"--board " + File("board.yaml"), "one of --images DIR"},
      {"--hand-eye --board " + File("board.yaml") + " --images " + File("empty"), "where the mount was"},
  };
  for (const auto& [arguments, word] : cases) {
    const auto output = Run("calibrate " + arguments + " --out " + File("out.yaml"));
    EXPECT_NE(output.code, 0) << arguments;
    EXPECT_NE(output.text.find(word), std::string::npos) << output.text;
    EXPECT_EQ(std::count(output.text.begin(), output.text.end(), '\n'), 1) << output.text;
  }
  EXPECT_FALSE(std::filesystem::exists(File("out.yaml")));
}

TEST_F(Calibrate, TruthOfRealPhotographsIsThatOfTheirAuthors) {
  VANTAGE_NEEDS_DATA("board");
  const auto data = testing::DataFolder() / "board";
  const auto output = Run("truth --board " + (data / "board_mm.json").string() + " --sequence " + data.string() +
                          " --frames 0:20 --out " + File("scene_camera.json"));
  ASSERT_EQ(output.code, 0) << output.text;
  EXPECT_EQ(output.json["with_pose"], output.json["frames"]);
  EXPECT_LT(output.json["difference_mm"]["median"].get<double>(), 0.6);
  EXPECT_LT(output.json["difference_mm"]["max"].get<double>(), 2.0);
  EXPECT_LT(output.json["difference_deg"]["max"].get<double>(), 0.3);
  std::ifstream stream(File("scene_camera.json"));
  const auto written = nlohmann::json::parse(stream);
  EXPECT_EQ(written["0"]["cam_R_w2c"].size(), 9u);
  EXPECT_TRUE(written["0"].contains("cam_K")) << "what else is known stays";
}

}  // namespace
}  // namespace vantage
