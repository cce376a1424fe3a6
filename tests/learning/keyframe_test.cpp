// What a frame leaves in the model.
#include "learning/keyframe.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

namespace vantage::learning {
namespace {

// A flat object, 100 x 100 pixels, 0.6 m before the camera; a chessboard of soft squares on it where `printed`.
rgbd::Frame FlatObject(bool printed) {
  rgbd::Frame frame;
  frame.camera.width = 320;
  frame.camera.height = 240;
  frame.camera.fx = frame.camera.fy = 525.0;
  frame.camera.cx = 160.0;
  frame.camera.cy = 120.0;
  frame.color = cv::Mat(240, 320, CV_8UC3, cv::Scalar::all(90));
  for (int y = 70; printed && y < 170; ++y) {
    for (int x = 110; x < 210; ++x) {
      if ((x / 10 + y / 10) % 2 == 0) frame.color.at<cv::Vec3b>(y, x) = cv::Vec3b::all(180);
    }
  }
  cv::GaussianBlur(frame.color, frame.color, {0, 0}, 1.5);
  frame.depth = cv::Mat(240, 320, CV_16UC1, cv::Scalar(600));
  return frame;
}

cv::Mat MaskOfIt() {
  cv::Mat mask = cv::Mat::zeros(240, 320, CV_8UC1);
  mask(cv::Rect(110, 70, 100, 100)).setTo(255);
  return mask;
}

geometry::Rigid InFront() {
  geometry::Rigid T = geometry::Rigid::Identity();
  T.translation().z() = 0.6;
  return T;
}

features::Features PointsAt(const std::vector<cv::KeyPoint>& keypoints) {
  features::Features features;
  features.keypoints = keypoints;
  features.descriptors = cv::Mat::ones(static_cast<int>(keypoints.size()), 128, CV_32F) * (1.0 / std::sqrt(128.0));
  return features;
}

TEST(Keyframe, PointsThatAreOfTheOutlineAreNotLearned) {
  const features::Features features = PointsAt({
      cv::KeyPoint(160.f, 120.f, 4.f),   // In the middle.
      cv::KeyPoint(160.f, 120.f, 40.f),  // There, and large, but not as large as the object.
      cv::KeyPoint(116.f, 120.f, 4.f),   // Small, six pixels from the outline.
      cv::KeyPoint(116.f, 120.f, 12.f),  // Reaches over it.
      cv::KeyPoint(110.f, 120.f, 2.f),   // On it.
      cv::KeyPoint(80.f, 120.f, 2.f),    // Beside the object.
  });
  const auto object = WithView({}, FlatObject(true), MaskOfIt(), features, InFront(), {}, 1);
  ASSERT_TRUE(object);
  ASSERT_EQ(object->views.front().features.size(), 3);
  EXPECT_EQ(object->views.front().features.keypoints[1].size, 40.f);
  EXPECT_EQ(object->views.front().features.keypoints[2].size, 4.f);
}

TEST(Keyframe, TextureIsTakenWhereBrightnessChangesAndInsideTheOutline) {
  const auto learned = [](bool printed) {
    return *WithView({}, FlatObject(printed), MaskOfIt(), PointsAt({cv::KeyPoint(160.f, 120.f, 4.f)}), InFront(), {}, 1);
  };
  const model::ObjectModel printed = learned(true);
  const auto texture = TextureOfView(printed.views.front(), 200);
  EXPECT_GT(texture.size(), 150u);
  EXPECT_LE(texture.size(), 210u);
  for (const pose::TexturePoint& point : texture) {
    EXPECT_LT(point.point.head<2>().cwiseAbs().maxCoeff(), 46.5 * 0.6 / 525.0);  // Four pixels inside.
    EXPECT_NEAR(point.point.z(), 0.0, 1e-9);
    EXPECT_GT(point.brightness, 85.0);
    EXPECT_LT(point.brightness, 185.0);
  }
  EXPECT_TRUE(TextureOfView(learned(false).views.front(), 200).empty());
  EXPECT_TRUE(TextureOfView(printed.views.front(), 0).empty());
  model::View without_depth = printed.views.front();
  without_depth.keyframe.depth = cv::Mat();
  EXPECT_TRUE(TextureOfView(without_depth, 200).empty());
}

}  // namespace
}  // namespace vantage::learning
