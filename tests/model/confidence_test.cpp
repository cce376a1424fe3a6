#include "model/confidence.h"

#include <gtest/gtest.h>

namespace vantage::model {
namespace {

const geometry::PinholeCamera kCamera{640, 480, 500, 500, 319.5, 239.5};

// A flat 11 x 11 grid of points that face the camera 1 m away, one view.
ObjectModel Grid() {
  ObjectModel model;
  View view;
  view.keyframe.camera = kCamera;
  view.T_camera_object.translation() = Eigen::Vector3d(0, 0, 1);
  for (int i = 0; i < 121; ++i) {
    const Eigen::Vector3d position(0.02 * (i % 11 - 5), 0.02 * (i / 11 - 5), 0);
    model.points.push_back({position, -Eigen::Vector3d::UnitZ()});
    const Eigen::Vector2d pixel = *kCamera.Project(view.T_camera_object * position);
    view.points.push_back(i);
    view.features.keypoints.emplace_back(pixel.x(), pixel.y(), 6.f);
  }
  model.views.push_back(view);
  return model;
}

rgbd::Frame Frame() {
  rgbd::Frame frame;
  frame.camera = kCamera;
  return frame;
}

TEST(Confidence, IsTheShareOfVisiblePointsWithAnInterestPoint) {
  const ObjectModel model = Grid();
  auto keypoints = model.views[0].features.keypoints;
  const auto value = [&](const std::vector<cv::KeyPoint>& detected) {
    return ObjectConfidence(model, model.views[0].T_camera_object, Frame(), KeypointGrid(detected, 640, 480), {});
  };
  EXPECT_EQ(value(keypoints).value, 1.0);
  EXPECT_EQ(value(keypoints).visible, 121);
  keypoints.resize(60);
  EXPECT_NEAR(value(keypoints).value, 60.0 / 121, 1e-12);
  EXPECT_EQ(value(keypoints).view, 0);
  const Confidence none = value({});  // What ought to be seen is said where nothing is.
  EXPECT_EQ(none.value, 0.0);
  EXPECT_EQ(none.visible, 121);
  EXPECT_EQ(none.view, 0);
}

TEST(Confidence, SupportMustBeNearAndOfTheExpectedSize) {
  const ObjectModel model = Grid();
  const auto shifted = [&](float dx, float factor) {
    auto keypoints = model.views[0].features.keypoints;
    for (cv::KeyPoint& keypoint : keypoints) {
      keypoint.pt.x += dx;
      keypoint.size *= factor;
    }
    return ObjectConfidence(model, model.views[0].T_camera_object, Frame(), KeypointGrid(keypoints, 640, 480), {}).value;
  };
  EXPECT_EQ(shifted(1.5f, 1.f), 1.0);
  EXPECT_EQ(shifted(3.f, 1.f), 0.0);
  EXPECT_EQ(shifted(0.f, 1.3f), 1.0);
  EXPECT_EQ(shifted(0.f, 2.f), 0.0);
  EXPECT_EQ(shifted(0.f, 0.5f), 0.0);
}

// Seen from twice as near, interest points are twice as large.
TEST(Confidence, TheExpectedSizeFollowsTheDistance) {
  const ObjectModel model = Grid();
  geometry::Rigid T = model.views[0].T_camera_object;
  T.translation().z() = 0.5;
  std::vector<cv::KeyPoint> keypoints;
  for (const ModelPoint& point : model.points) {
    const Eigen::Vector2d pixel = *kCamera.Project(T * point.position);
    keypoints.emplace_back(pixel.x(), pixel.y(), 12.f);
  }
  EXPECT_EQ(ObjectConfidence(model, T, Frame(), KeypointGrid(keypoints, 640, 480), {}).value, 1.0);
}

TEST(Confidence, PointsThatAreHiddenOrFaceAwayDoNotCount) {
  const ObjectModel model = Grid();
  const KeypointGrid grid(model.views[0].features.keypoints, 640, 480);
  rgbd::Frame frame = Frame();
  frame.depth = cv::Mat(480, 640, CV_16UC1, cv::Scalar(1000));
  frame.depth(cv::Rect(0, 0, 320, 480)).setTo(500);  // Something stands in front of the left half.
  const Confidence half = ObjectConfidence(model, model.views[0].T_camera_object, frame, grid, {});
  EXPECT_LT(half.visible, 70);
  EXPECT_EQ(half.value, 1.0);
  geometry::Rigid behind = model.views[0].T_camera_object;
  behind.rotate(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitY()));
  EXPECT_EQ(ObjectConfidence(model, behind, Frame(), grid, {}).visible, 0);
}

TEST(Model, PartsKeepTheirPoints) {
  ObjectModel model = Grid();
  View second = model.views[0];
  second.id = 1;
  second.points = {120, 3};
  second.features.keypoints.resize(2);
  model.views.push_back(second);
  const ObjectModel part = model.OnlyView(1);
  ASSERT_EQ(part.views.size(), 1u);
  ASSERT_EQ(part.points.size(), 2u);
  EXPECT_EQ(part.views[0].id, 1);
  EXPECT_EQ(part.points[part.views[0].points[0]].position, model.points[120].position);
  EXPECT_NEAR(model.views[0].viewpoint().distance_m, 1.0, 1e-12);
  EXPECT_NEAR(MeanPointDistance(model.PointMatrix(), model.views[0].T_camera_object, model.views[0].T_camera_object), 0, 1e-12);
}

}  // namespace
}  // namespace vantage::model
