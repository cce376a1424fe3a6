#include "rgbd/bop.h"

#include <gtest/gtest.h>

#include <fstream>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>

#include "support/data.h"
#include "support/temp_folder.h"

namespace vantage::rgbd {
namespace {

const char kCamera[] = R"({
  "3": {"cam_K": [500, 0, 31.5, 0, 510, 23.5, 0, 0, 1], "depth_scale": 0.1,
        "cam_R_w2c": [0, -1, 0, 1, 0, 0, 0, 0, 1], "cam_t_w2c": [100, 200, 300]},
  "12": {"cam_K": [500, 0, 31.5, 0, 510, 23.5, 0, 0, 1], "depth_scale": 1.0}})";

// A scene of two small frames, to be broken in one place by each test.
class BopFolder : public ::testing::Test {
 protected:
  void SetUp() override {
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    folder_.Write("scene_camera.json", kCamera);
    for (const char* name : {"rgb", "depth", "label"}) std::filesystem::create_directories(folder_ / name);
    cv::imwrite((folder_ / "rgb/000003.png").string(), cv::Mat(48, 64, CV_8UC3, cv::Scalar(10, 20, 30)));
    cv::imwrite((folder_ / "rgb/000012.jpg").string(), cv::Mat(48, 64, CV_8UC3, cv::Scalar(10, 20, 30)));
    cv::Mat depth(48, 64, CV_16UC1, cv::Scalar(8004));
    depth.at<std::uint16_t>(0, 0) = 0;
    depth.at<std::uint16_t>(0, 1) = 8006;
    cv::imwrite((folder_ / "depth/000003.png").string(), depth);
    cv::imwrite((folder_ / "depth/000012.png").string(), depth);
    cv::imwrite((folder_ / "label/000003.png").string(), cv::Mat(48, 64, CV_8UC1, cv::Scalar(7)));
  }

  // What opening the folder and loading the frame complains about; empty where it does not.
  std::string Complaint(int id = 3) const {
    try {
      BopScene(folder_.path()).Load(id);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }

  testing::TempFolder folder_;
};

bool Has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

#define EXPECT_COMPLAINT(text, file, about)                                   \
  {                                                                           \
    const std::string complaint = (text);                                     \
    EXPECT_TRUE(Has(complaint, file) && Has(complaint, about)) << complaint;  \
    EXPECT_EQ(complaint.find('\n'), std::string::npos) << "more than a line"; \
  }

TEST_F(BopFolder, FramesComeWithCameraDepthInMillimetresAndPose) {
  const BopScene scene(folder_.path());
  EXPECT_EQ(scene.ids(), (std::vector<int>{3, 12}));
  const Frame frame = scene.Load(3);
  EXPECT_NO_THROW(CheckFrame(frame));
  EXPECT_EQ(frame.id, 3);
  EXPECT_EQ(frame.utime, 3 * 33333);
  EXPECT_EQ(frame.color.at<cv::Vec3b>(5, 5), cv::Vec3b(10, 20, 30));
  EXPECT_EQ(frame.depth.at<std::uint16_t>(0, 0), 0);
  EXPECT_EQ(frame.depth.at<std::uint16_t>(0, 1), 801) << "800.6 mm";
  EXPECT_EQ(frame.depth.at<std::uint16_t>(9, 9), 800) << "800.4 mm";
  EXPECT_EQ(frame.camera, (geometry::PinholeCamera{64, 48, 500, 510, 31.5, 23.5}));
  ASSERT_TRUE(frame.T_world_camera);
  // The world's origin lies at (0.1, 0.2, 0.3) in the camera, so the camera's lies at -R^T t in the world.
  EXPECT_LT((frame.T_world_camera->translation() - Eigen::Vector3d(-0.2, 0.1, -0.3)).norm(), 1e-12);
  EXPECT_FALSE(scene.Load(12).T_world_camera);
  EXPECT_EQ(scene.Load(12).depth.at<std::uint16_t>(9, 9), 8004);
  EXPECT_EQ(scene.LoadLabel(3).at<std::uint8_t>(4, 4), 7);
  EXPECT_FALSE(scene.has_truth());
  EXPECT_TRUE(scene.Truth(3).empty());
}

TEST_F(BopFolder, TruthIsReadInMetres) {
  folder_.Write("scene_gt.json", R"({"3": [{"obj_id": 6, "cam_R_m2c": [1,0,0, 0,1,0, 0,0,1], "cam_t_m2c": [10, 20, 800]}]})");
  const BopScene scene(folder_.path());
  ASSERT_EQ(scene.Truth(3).size(), 1u);
  EXPECT_TRUE(scene.has_truth());
  EXPECT_EQ(scene.Truth(3)[0].object_id, 6);
  EXPECT_LT((scene.Truth(3)[0].T_camera_object.translation() - Eigen::Vector3d(0.01, 0.02, 0.8)).norm(), 1e-12);
  EXPECT_TRUE(scene.Truth(12).empty());
}

TEST_F(BopFolder, WithoutDepthFolderFramesHaveNoDepth) {
  std::filesystem::remove_all(folder_ / "depth");
  std::filesystem::remove_all(folder_ / "label");
  EXPECT_TRUE(BopScene(folder_.path()).Load(3).depth.empty());
  EXPECT_TRUE(BopScene(folder_.path()).LoadLabel(3).empty());
}

TEST_F(BopFolder, WhatIsMissingIsNamed) {
  EXPECT_COMPLAINT(Complaint(4), "scene_camera.json", "frame 4");
  std::filesystem::remove(folder_ / "depth/000003.png");
  EXPECT_COMPLAINT(Complaint(), "depth/000003.png", "no such file");
  std::filesystem::remove(folder_ / "rgb/000003.png");
  EXPECT_COMPLAINT(Complaint(), "rgb/000003", "no such file");
  std::filesystem::remove(folder_ / "scene_camera.json");
  EXPECT_COMPLAINT(Complaint(), "scene_camera.json", "expected");
  std::filesystem::remove_all(folder_.path());
  EXPECT_COMPLAINT(Complaint(), folder_.path().string(), "no such folder");
}

TEST_F(BopFolder, DepthOfAnotherSizeOrTypeIsRefused) {
  cv::imwrite((folder_ / "depth/000003.png").string(), cv::Mat(24, 32, CV_16UC1, cv::Scalar(1)));
  EXPECT_COMPLAINT(Complaint(), "depth/000003.png", "32x24");
  cv::imwrite((folder_ / "depth/000003.png").string(), cv::Mat(48, 64, CV_8UC1, cv::Scalar(1)));
  EXPECT_COMPLAINT(Complaint(), "depth/000003.png", "16-bit");
}

TEST_F(BopFolder, FilesThatAreNoImagesAreRefused) {
  folder_.Write("rgb/000003.png", "not an image");
  EXPECT_COMPLAINT(Complaint(), "rgb/000003.png", "expected an image");
  folder_.Write("depth/000012.png", "");
  EXPECT_COMPLAINT(Complaint(12), "depth/000012.png", "expected an image");
}

TEST_F(BopFolder, BrokenJsonIsNamedWithItsFrameAndField) {
  const std::string text = kCamera;
  folder_.Write("scene_camera.json", text.substr(0, 150));
  EXPECT_COMPLAINT(Complaint(), "scene_camera.json", "JSON");
  folder_.Write("scene_camera.json", "[1, 2]");
  EXPECT_COMPLAINT(Complaint(), "scene_camera.json", "array");
  folder_.Write("scene_camera.json", "{}");
  EXPECT_COMPLAINT(Complaint(), "scene_camera.json", "at least one frame");
  const auto broken = [&](const std::string& from, const std::string& to, const std::string& about) {
    std::string changed = text;
    changed.replace(changed.find(from), from.size(), to);
    folder_.Write("scene_camera.json", changed);
    EXPECT_COMPLAINT(Complaint(), "scene_camera.json", about);
  };
  broken("\"cam_K\": [500, 0,", "\"cam_K\": [500,", "cam_K");
  broken("\"cam_K\"", "\"cam_Q\"", "cam_K");
  broken("[500,", "[-5,", "focal");
  broken("[500,", "[\"a\",", "cam_K");
  broken("0.1,", "0,", "depth_scale");
  broken("[0, -1, 0,", "[0, -1, 5,", "rotation");
  broken("cam_t_w2c", "cam_t", "cam_t_w2c");
  broken("\"3\"", "\"three\"", "three");
  broken("{\"cam_K\": [500, 0, 31.5, 0, 510, 23.5, 0, 0, 1], \"depth_scale\": 1.0}", "7", "cam_K");
  folder_.Write("scene_camera.json", text);
  folder_.Write("scene_gt.json", R"({"3": [{"cam_R_m2c": [1,0,0, 0,1,0, 0,0,1], "cam_t_m2c": [10, 20, 800]}]})");
  EXPECT_COMPLAINT(Complaint(), "scene_gt.json", "obj_id");
  folder_.Write("scene_gt.json", R"({"3": 5})");
  EXPECT_COMPLAINT(Complaint(), "scene_gt.json", "list");
}

TEST(SelectFrames, TakesWhatIsAskedFor) {
  const std::vector<int> ids{0, 1, 3, 4, 6};
  EXPECT_EQ(SelectFrames(ids, "all"), ids);
  EXPECT_EQ(SelectFrames(ids, "even"), (std::vector<int>{0, 4, 6}));
  EXPECT_EQ(SelectFrames(ids, "odd"), (std::vector<int>{1, 3}));
  EXPECT_EQ(SelectFrames(ids, "1:4"), (std::vector<int>{1, 3}));
  EXPECT_EQ(SelectFrames(ids, ":3"), (std::vector<int>{0, 1}));
  EXPECT_EQ(SelectFrames(ids, "4:"), (std::vector<int>{4, 6}));
  EXPECT_EQ(SelectFrames(ids, ":"), ids);
  EXPECT_TRUE(SelectFrames(ids, "9:").empty());
  for (const char* wrong : {"", "evens", "3", "a:b", "1:2:3", "-1:4", "1-4", "99999999999:"})
    EXPECT_THROW(SelectFrames(ids, wrong), std::invalid_argument) << wrong;
}

TEST(RealScenes, OpenAndEveryThirdFrameIsGood) {
  for (const char* name : {"board", "shelf_box", "ycbv", "osd"}) {
    VANTAGE_NEEDS_DATA(name);
    const BopScene scene(testing::DataFolder() / name);
    EXPECT_TRUE(std::is_sorted(scene.ids().begin(), scene.ids().end()));
    for (std::size_t i = 0; i < scene.ids().size(); i += 10) {
      const Frame frame = scene.Load(scene.ids()[i]);
      EXPECT_NO_THROW(CheckFrame(frame)) << name << " " << frame.id;
      EXPECT_GT(cv::countNonZero(frame.depth), 30000) << name << " " << frame.id;
      EXPECT_EQ(frame.T_world_camera.has_value(), std::string(name) != "osd");
    }
  }
}

// The pose of an object and the depth at its place agree: units and directions are right.
TEST(RealScenes, TruthLiesOnTheMeasuredSurface) {
  VANTAGE_NEEDS_DATA("ycbv");
  const BopScene scene(testing::DataFolder() / "ycbv");
  const Frame frame = scene.Load(3);
  for (const ObjectTruth& truth : scene.Truth(3)) {
    if (truth.object_id == 25) continue;  // The mug is hollow.
    const Eigen::Vector3d centre = truth.T_camera_object.translation();
    const std::optional<double> depth_m = DepthAt(frame, *frame.camera.Project(centre), 4);
    ASSERT_TRUE(depth_m);
    EXPECT_NEAR(*depth_m, centre.z(), 0.06) << "object " << truth.object_id;
  }
}

}  // namespace
}  // namespace vantage::rgbd
