#include "rgbd/tum.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "rgbd/bop.h"
#include "support/temp_folder.h"

namespace vantage::rgbd {
namespace {

class TumFolder : public ::testing::Test {
 protected:
  TumFolder() {
    folder_.Write("rgb.txt",
                  "# color images\n# file: 'x'\n# timestamp filename\n1305031102.175304 rgb/a.png\n1305031102.211214 rgb/b.png\n"
                  "1305031102.243211 rgb/c.png\n");
    folder_.Write("depth.txt",
                  "# depth maps\n1305031102.160407 depth/a.png\n1305031102.226738 depth/b.png\n1305031109.0 depth/c.png\n");
    folder_.Write("groundtruth.txt",
                  "# ground truth trajectory\n1305031102.1753 1 2 3 0 0 0 1\n1305031102.2253 1.5 2 3 0 0 0.7071 0.7071\n");
    std::filesystem::create_directories(folder_ / "rgb");
    std::filesystem::create_directories(folder_ / "depth");
    for (const char* name : {"a", "b", "c"}) {
      cv::imwrite((folder_ / ("rgb/" + std::string(name) + ".png")).string(), cv::Mat(48, 64, CV_8UC3, cv::Scalar(10, 20, *name)));
      cv::imwrite((folder_ / ("depth/" + std::string(name) + ".png")).string(), cv::Mat(48, 64, CV_16UC1, cv::Scalar(5000)));
    }
  }
  std::string Complaint() const {
    try {
      BopScene scene(folder_.path());
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }
  testing::TempFolder folder_;
};

TEST_F(TumFolder, IsASceneLikeAnyOther) {
  const BopScene scene(folder_.path());
  ASSERT_EQ(scene.ids(), (std::vector<int>{0, 1})) << "the third colour image's depth is not near";
  const Frame frame = scene.Load(1);
  EXPECT_NO_THROW(CheckFrame(frame));
  EXPECT_EQ(frame.utime, 1305031102211214);
  EXPECT_EQ(frame.color.at<cv::Vec3b>(0, 0)[2], 'b');
  EXPECT_EQ(frame.depth.at<std::uint16_t>(5, 5), 1000) << "5000 units are a metre";
  EXPECT_DOUBLE_EQ(frame.camera.fx, 525.0);
  ASSERT_TRUE(frame.T_world_camera);
  EXPECT_NEAR(frame.T_world_camera->translation().x(), 1.0 + 0.5 * 35.914 / 50.0, 1e-4) << "between the two poses";
  EXPECT_NEAR(geometry::RotationAngle(frame.T_world_camera->linear()), M_PI / 2 * 35.914 / 50.0, 1e-3);
  EXPECT_TRUE(scene.CameraPose(0)) << "4 us after the first pose";
  EXPECT_FALSE(scene.has_truth());
}

TEST_F(TumFolder, ItsOwnCalibrationCounts) {
  folder_.Write("calibration.txt", "481.2 480.0 319.5 239.5");
  EXPECT_DOUBLE_EQ(BopScene(folder_.path()).Load(0).camera.fx, 481.2);
  folder_.Write("calibration.txt", "none");
  EXPECT_NE(Complaint().find("calibration.txt"), std::string::npos) << Complaint();
}

TEST_F(TumFolder, WhatIsBrokenIsNamedWithItsLine) {
  folder_.Write("depth.txt", "1305031102.160407 depth/a.png\nsoon depth/b.png\n");
  EXPECT_NE(Complaint().find("depth.txt:2"), std::string::npos) << Complaint();
  folder_.Write("depth.txt", "1.0 depth/a.png\n");
  EXPECT_NE(Complaint().find("20 ms"), std::string::npos) << Complaint();
  folder_.Write("depth.txt", "1305031102.160407 depth/a.png\n");
  folder_.Write("groundtruth.txt", "1305031102.1753 1 2 3 0 0 0 7\n");
  EXPECT_NE(Complaint().find("quaternion"), std::string::npos) << Complaint();
}

}  // namespace
}  // namespace vantage::rgbd
