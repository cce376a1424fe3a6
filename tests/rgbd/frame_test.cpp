#include "rgbd/frame.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>

namespace vantage::rgbd {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// A plane normal.dot(x) + offset == 0 seen by a small camera.
Frame PlaneFrame(const Vector3d& normal, double offset_m) {
  Frame frame;
  frame.camera = {80, 60, 100, 100, 39.5, 29.5};
  frame.color = cv::Mat(60, 80, CV_8UC3, cv::Scalar(50, 100, 150));
  frame.depth = cv::Mat(60, 80, CV_16UC1);
  for (int y = 0; y < 60; ++y)
    for (int x = 0; x < 80; ++x) {
      const double z = -offset_m / normal.dot(frame.camera.Unproject(Vector2d(x, y), 1.0));
      frame.depth.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(std::lround(1000.0 * z));
    }
  return frame;
}

TEST(Depth, IsReadAtTheRoundedPixelInMetres) {
  Frame frame = PlaneFrame({0, 0, -1}, 0.8);
  frame.depth.at<std::uint16_t>(20, 30) = 912;
  EXPECT_DOUBLE_EQ(*DepthAt(frame, {30.4, 19.6}), 0.912);
  EXPECT_DOUBLE_EQ(*DepthAt(frame, {31.0, 20.0}), 0.8);
  EXPECT_DOUBLE_EQ(*DepthAt(frame, {-0.4, 59.4}), 0.8);
  EXPECT_FALSE(DepthAt(frame, {-0.6, 20}));
  EXPECT_FALSE(DepthAt(frame, {20, 59.6}));
  EXPECT_FALSE(DepthAt(frame, {std::nan(""), 20}));
  EXPECT_FALSE(DepthAt(frame, {1e300, 20}));
}

TEST(Depth, InAHoleIsTheMedianOfWhatWasMeasuredNearby) {
  Frame frame = PlaneFrame({0, 0, -1}, 0.8);
  frame.depth(cv::Rect(29, 19, 3, 3)).setTo(0);
  frame.depth.at<std::uint16_t>(20, 32) = 2000;  // One outlier among those two pixels away.
  EXPECT_DOUBLE_EQ(*DepthAt(frame, {30, 20}, 2), 0.8);
  EXPECT_FALSE(DepthAt(frame, {30, 20}, 1));
  EXPECT_FALSE(DepthAt(frame, {30, 20}, 0));
  frame.depth = cv::Mat();
  EXPECT_FALSE(DepthAt(frame, {30, 20}));
  EXPECT_FALSE(PointAt(frame, {30, 20}));
  EXPECT_FALSE(NormalAt(frame, {30, 20}));
}

TEST(Point, LiesOnTheRayOfTheUnroundedPixel) {
  const Frame frame = PlaneFrame({0, 0, -1}, 0.8);
  EXPECT_LT((*PointAt(frame, {49.7, 29.5}) - Vector3d(0.0816, 0.0, 0.8)).norm(), 1e-9);
}

TEST(Normal, IsThatOfASlantedPlaneAndFacesTheCamera) {
  for (const Vector3d& direction : {Vector3d(0, 0, -1), Vector3d(0, -0.8, -0.6), Vector3d(0.6, 0.2, -0.7)}) {
    const Vector3d normal = direction.normalized();
    Frame frame = PlaneFrame(normal, 0.5);
    for (int x = 0; x < 80; x += 3) frame.depth.col(x).setTo(0);
    const std::optional<Vector3d> found = NormalAt(frame, {40, 45});
    ASSERT_TRUE(found);
    EXPECT_LT(std::acos(std::min(1.0, found->dot(normal))), 0.03) << direction.transpose();
    EXPECT_NEAR(found->norm(), 1.0, 1e-9);
  }
}

TEST(Normal, IsNoneAtADepthEdgeAndWhereLittleWasMeasured) {
  Frame frame = PlaneFrame({0, 0, -1}, 0.8);
  frame.depth.colRange(40, 80).setTo(900);
  EXPECT_FALSE(NormalAt(frame, {40, 30}));
  EXPECT_TRUE(NormalAt(frame, {50, 30}));
  frame.depth(cv::Rect(50, 20, 20, 10)).setTo(0);
  EXPECT_FALSE(NormalAt(frame, {58, 28}));
  EXPECT_FALSE(NormalAt(PlaneFrame({0, 0, -1}, 0.8), {-30, 2}));
}

TEST(Cloud, HoldsEveryPixelsPointAndNanWhereThereIsNone) {
  Frame frame = PlaneFrame({0, 0, -1}, 0.8);
  frame.depth.at<std::uint16_t>(3, 4) = 0;
  const cv::Mat cloud = OrganisedCloud(frame);
  ASSERT_EQ(cloud.type(), CV_32FC3);
  ASSERT_EQ(cloud.size(), frame.depth.size());
  EXPECT_TRUE(std::isnan(cloud.at<cv::Vec3f>(3, 4)[0]) && std::isnan(cloud.at<cv::Vec3f>(3, 4)[2]));
  const cv::Vec3f point = cloud.at<cv::Vec3f>(10, 70);
  EXPECT_LT((Vector3d(point[0], point[1], point[2]) - frame.camera.Unproject({70, 10}, 0.8)).norm(), 1e-6);
}

TEST(Gray, IsOneChannelOfTheSameSize) {
  const cv::Mat gray = Gray(PlaneFrame({0, 0, -1}, 0.8));
  EXPECT_EQ(gray.type(), CV_8UC1);
  EXPECT_EQ(gray.size(), cv::Size(80, 60));
  EXPECT_NEAR(gray.at<std::uint8_t>(5, 5), 0.114 * 50 + 0.587 * 100 + 0.299 * 150, 1.0);
}

TEST(CheckFrame, SaysWhatIsWrong) {
  const auto complaint = [](const std::function<void(Frame&)>& spoil) -> std::string {
    Frame frame = PlaneFrame({0, 0, -1}, 0.8);
    spoil(frame);
    try {
      CheckFrame(frame);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(complaint([](Frame&) {}), "");
  EXPECT_EQ(complaint([](Frame& frame) { frame.depth = cv::Mat(); }), "");
  EXPECT_NE(complaint([](Frame& frame) { frame.color = cv::Mat(); }).find("colour"), std::string::npos);
  EXPECT_NE(complaint([](Frame& frame) { frame.color = cv::Mat(60, 80, CV_8UC1); }).find("CV_8UC1"), std::string::npos);
  EXPECT_NE(complaint([](Frame& frame) { frame.camera.width = 81; }).find("81x60"), std::string::npos);
  EXPECT_NE(complaint([](Frame& frame) { frame.camera.fx = 0; }).find("fx"), std::string::npos);
  EXPECT_NE(complaint([](Frame& frame) { frame.depth = cv::Mat(30, 40, CV_16UC1); }).find("40x30"), std::string::npos);
  EXPECT_NE(complaint([](Frame& frame) { frame.depth = cv::Mat(60, 80, CV_32FC1); }).find("CV_32FC1"), std::string::npos);
}

}  // namespace
}  // namespace vantage::rgbd
