#include "assessment/virtual_object.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "geometry/rigid.h"

namespace vantage::assessment {
namespace {

constexpr double kDegree = M_PI / 180.0;

cv::Mat SmoothTexture(int width, int height, std::uint32_t seed) {
  cv::RNG random(seed);
  cv::Mat image(height, width, CV_8UC3);
  random.fill(image, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(image, image, cv::Size(), 4.0);
  cv::normalize(image, image, 40, 215, cv::NORM_MINMAX);
  return image;
}

// A keyframe of a flat square, 0.16 m wide, half a metre away; `turn_rad` turns it about its vertical axis.
model::View FlatView(double turn_rad, std::uint32_t seed) {
  model::View view;
  view.T_camera_object.translation() << 0.05, -0.02, 0.5;
  view.T_camera_object.linear() = Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitY()).toRotationMatrix();
  rgbd::Frame& frame = view.keyframe;
  frame.camera = {320, 240, 500.0, 500.0, 110.0, 140.0};
  frame.color = SmoothTexture(320, 240, seed);
  frame.depth = cv::Mat(240, 320, CV_16UC1, cv::Scalar(0));
  view.mask = cv::Mat(240, 320, CV_8UC1, cv::Scalar(0));
  const geometry::Rigid T_object_camera = view.T_camera_object.inverse();
  for (int y = 0; y < 240; ++y) {
    for (int x = 0; x < 320; ++x) {
      // The ray meets the plane z = 0 of the object.
      const Eigen::Vector3d ray = T_object_camera.linear() * frame.camera.Unproject({x, y}, 1.0);
      const Eigen::Vector3d eye = T_object_camera.translation();
      const double depth_m = -eye.z() / ray.z();
      const Eigen::Vector3d point = eye + depth_m * ray;
      if (point.head<2>().cwiseAbs().maxCoeff() > 0.08) continue;
      frame.depth.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(std::lround(1000.0 * depth_m));
      view.mask.at<std::uint8_t>(y, x) = 255;
    }
  }
  return view;
}

model::ObjectModel FlatObject() {
  model::ObjectModel object;
  object.name = "square";
  object.views.push_back(FlatView(0.0, 1));
  return object;
}

TEST(VirtualCameraPose, RotatesScalesAndLooksAtTheObject) {
  const model::View view = FlatView(0.3, 1);
  for (double rotation : {0.0, 12.0, 44.0, 60.0}) {
    for (double tilt : {0.0, 1.0, 4.0}) {
      const geometry::Rigid T = VirtualCameraPose(view, {rotation * kDegree, tilt, 2.0 * tilt, -0.7});
      EXPECT_NEAR(geometry::AngleBetween(geometry::ViewDirection(T), view.viewpoint().direction), rotation * kDegree, 1e-6);
      const double distance = T.translation().norm();
      EXPECT_NEAR(std::log2(view.viewpoint().distance_m / distance), -0.7, 1e-9);
      EXPECT_NEAR(T.translation().z(), distance, 1e-9);
      EXPECT_NEAR(T.linear().determinant(), 1.0, 1e-9);
    }
  }
}

TEST(VirtualObject, FromTheLearnedPoseItLooksAsItDid) {
  const model::ObjectModel object = FlatObject();
  const VirtualObject surface(object);
  const model::View& view = object.views[0];
  const VirtualImage image = surface.Render(view.keyframe.camera, view.T_camera_object);
  cv::Mat inner;
  cv::erode(image.mask, inner, cv::Mat(), cv::Point(-1, -1), 3);
  ASSERT_GT(cv::countNonZero(image.mask), 0.93 * cv::countNonZero(view.mask));
  EXPECT_LE(cv::countNonZero(image.mask & ~view.mask), 0);
  cv::Mat difference;
  cv::absdiff(image.color, view.keyframe.color, difference);
  const cv::Scalar mean = cv::mean(difference, inner);
  EXPECT_LT(mean[0] + mean[1] + mean[2], 3.0 * 2.5);
}

TEST(VirtualObject, DepthThatIsHalfHolesShowsNearlyAllOfIt) {
  model::ObjectModel object = FlatObject();
  const model::View& view = object.views[0];
  const int whole = cv::countNonZero(VirtualObject(object).Render(view.keyframe.camera, view.T_camera_object).mask);
  // As depth registered to the colours of a near object.
  cv::RNG random(5);
  cv::Mat& depth = object.views[0].keyframe.depth;
  for (int y = 0; y < depth.rows; ++y) {
    for (int x = 0; x < depth.cols; ++x) {
      if (random.uniform(0, 2) == 0) depth.at<std::uint16_t>(y, x) = 0;
    }
  }
  const int with_holes = cv::countNonZero(VirtualObject(object).Render(view.keyframe.camera, view.T_camera_object).mask);
  EXPECT_GT(with_holes, 0.8 * whole);
}

TEST(VirtualObject, TheRimThatHasNoDepthIsShown) {
  model::ObjectModel object = FlatObject();
  const model::View& view = object.views[0];
  cv::Mat inner;
  cv::erode(view.mask, inner, cv::Mat(), cv::Point(-1, -1), 4);
  object.views[0].keyframe.depth.setTo(0, inner == 0);
  const VirtualImage image = VirtualObject(object).Render(view.keyframe.camera, view.T_camera_object);
  EXPECT_GT(cv::countNonZero(image.mask), 0.97 * cv::countNonZero(view.mask));
  EXPECT_EQ(cv::countNonZero(image.mask & ~view.mask), 0);
}

TEST(VirtualObject, WhatIsBehindDoesNotShineThroughNarrowGaps) {
  model::ObjectModel object = FlatObject();
  model::View& view = object.views[0];
  const int x = static_cast<int>(view.keyframe.camera.Project(view.T_camera_object.translation())->x());
  const auto shown = [&] { return VirtualObject(object).Render(view.keyframe.camera, view.T_camera_object).mask; };
  const cv::Mat whole = shown();
  view.mask.colRange(x, x + 4).setTo(0);
  EXPECT_GT(cv::countNonZero(shown()), 0.99 * cv::countNonZero(whole));
  view.mask.colRange(x, x + 20).setTo(0);
  EXPECT_LT(cv::countNonZero(shown()), 0.95 * cv::countNonZero(whole));
}

TEST(Relight, BrightnessFollowsWhatFallsOnTheSurface) {
  const model::ObjectModel object = FlatObject();  // It faces -z.
  const VirtualImage seen = VirtualObject(object).Render(object.views[0].keyframe.camera, object.views[0].T_camera_object);
  cv::Mat inner;
  cv::erode(seen.mask, inner, cv::Mat(), cv::Point(-1, -1), 4);
  const auto brightness = [&](const Light& before, const Light& after) {
    VirtualImage image = seen;
    image.color = cv::Mat(seen.color.size(), CV_8UC3, cv::Scalar::all(100));
    Relight(before, after, &image);
    EXPECT_EQ(image.color.at<cv::Vec3b>(0, 0), cv::Vec3b(100, 100, 100));  // Not of the object.
    return cv::mean(image.color, inner)[1];
  };
  const Light everywhere{1.0, Eigen::Vector3d::UnitX()};
  const Light ahead{0.6, -Eigen::Vector3d::UnitZ()}, behind{0.6, Eigen::Vector3d::UnitZ()};
  const Light aslant{0.6, Eigen::Vector3d(0.0, std::sin(1.0), -std::cos(1.0))};
  EXPECT_NEAR(brightness(everywhere, everywhere), 100.0, 0.1);
  EXPECT_NEAR(brightness(ahead, behind), 60.0, 1.0);
  EXPECT_NEAR(brightness(behind, ahead), 100.0 / 0.6, 2.0);
  EXPECT_NEAR(brightness(ahead, aslant), 100.0 * (0.6 + 0.4 * std::cos(1.0)), 1.5);
}

TEST(VirtualObject, TurnedAwayItIsForeshortenedAndFromBehindNotThere) {
  const model::ObjectModel object = FlatObject();
  const VirtualObject surface(object);
  // To both sides, since the camera did not learn it quite head on.
  const auto area = [&](double rotation_deg) {
    double sum = 0.0;
    for (double tilt : {M_PI_2, -M_PI_2}) {
      const geometry::Rigid T = VirtualCameraPose(object.views[0], {rotation_deg * kDegree, tilt, 0.0, 0.0});
      sum += cv::countNonZero(surface.Render(surface.Window(0, T, 640, 480), T).mask);
    }
    return sum;
  };
  EXPECT_NEAR(area(60.0) / area(0.0), 0.5, 0.06);

  geometry::Rigid behind = object.views[0].T_camera_object;
  behind.linear() = behind.linear() * Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitY()).toRotationMatrix();
  EXPECT_EQ(cv::countNonZero(surface.Render(object.views[0].keyframe.camera, behind).mask), 0);
}

TEST(VirtualObject, OtherViewsFillWhatTheNearestDidNotSee) {
  model::ObjectModel object = FlatObject();
  object.views.push_back(FlatView(0.2, 2));
  model::View& first = object.views[0];
  first.mask(cv::Rect(0, 0, first.mask.cols / 2, first.mask.rows)).setTo(0);  // It saw the right half only.
  const VirtualObject surface(object);
  const VirtualImage image = surface.Render(first.keyframe.camera, first.T_camera_object);
  const cv::Mat whole = FlatView(0.0, 1).mask;
  EXPECT_GT(cv::countNonZero(image.mask), 0.93 * cv::countNonZero(whole));
  // What the nearest view knows is shown as it saw it.
  cv::Mat inner, difference;
  cv::erode(first.mask, inner, cv::Mat(), cv::Point(-1, -1), 3);
  cv::absdiff(image.color, first.keyframe.color, difference);
  EXPECT_LT(cv::mean(difference, inner)[0], 3.0);
}

TEST(VirtualObject, WindowHoldsTheObjectAndKeepsItsLimits) {
  const model::ObjectModel object = FlatObject();
  const VirtualObject surface(object);
  const geometry::Rigid far = VirtualCameraPose(object.views[0], {0.3, 0.2, 0.1, -1.0});
  const geometry::PinholeCamera small = surface.Window(0, far, 640, 480);
  EXPECT_LT(small.width, 200);
  for (double x : {-0.08, 0.08}) {
    for (double y : {-0.08, 0.08}) {
      const auto pixel = small.Project(far * Eigen::Vector3d(x, y, 0.0));
      ASSERT_TRUE(pixel && small.Contains(*pixel, 20.0));
    }
  }
  const geometry::Rigid near = VirtualCameraPose(object.views[0], {0.0, 0.0, 0.0, 1.0});
  const geometry::PinholeCamera large = surface.Window(0, near, 300, 200);
  EXPECT_EQ(large.width, 300);
  EXPECT_EQ(large.height, 200);
  EXPECT_EQ(large.fx, object.views[0].keyframe.camera.fx);
}

TEST(Paste, ShowsTheObjectInsideAndTheBackgroundOutside) {
  VirtualImage object{cv::Mat(40, 60, CV_8UC3, cv::Scalar::all(0)), cv::Mat(40, 60, CV_8UC1, cv::Scalar(0)), cv::Mat()};
  object.color(cv::Rect(20, 10, 20, 20)).setTo(cv::Scalar(10, 20, 250));
  object.mask(cv::Rect(20, 10, 20, 20)).setTo(255);
  const cv::Mat background(50, 70, CV_8UC3, cv::Scalar(200, 100, 50));
  const cv::Mat image = Paste(object, background);
  ASSERT_EQ(image.size(), object.color.size());
  EXPECT_EQ(image.at<cv::Vec3b>(20, 30), cv::Vec3b(10, 20, 250));
  EXPECT_EQ(image.at<cv::Vec3b>(5, 5), cv::Vec3b(200, 100, 50));
  const int rim = image.at<cv::Vec3b>(20, 20)[2];
  EXPECT_GT(rim, 50);
  EXPECT_LT(rim, 250);
  EXPECT_THROW(Paste(object, background(cv::Rect(0, 0, 30, 30))), std::invalid_argument);
}

TEST(Disturb, NoiseHasTheSigmaAskedForAndIsSeeded) {
  const cv::Mat grey(200, 200, CV_8UC3, cv::Scalar::all(128));
  cv::Mat a = grey.clone(), b = grey.clone(), c = grey.clone();
  Disturb({1.0, 1.0, 0.0, 12.0}, 5, &a);
  Disturb({1.0, 1.0, 0.0, 12.0}, 5, &b);
  Disturb({1.0, 1.0, 0.0, 12.0}, 6, &c);
  EXPECT_EQ(cv::norm(a, b, cv::NORM_INF), 0.0);
  EXPECT_GT(cv::norm(a, c, cv::NORM_INF), 0.0);
  cv::Mat as_grey;
  cv::cvtColor(a, as_grey, cv::COLOR_BGR2GRAY);
  cv::Scalar mean, sigma;
  cv::meanStdDev(as_grey, mean, sigma);
  EXPECT_NEAR(mean[0], 128.0, 1.0);
  EXPECT_NEAR(sigma[0], 12.0, 0.5);
}

TEST(Disturb, BrightnessAndBlur) {
  cv::Mat image(50, 50, CV_8UC3, cv::Scalar::all(100)), same = image.clone(), edge(50, 50, CV_8UC3, cv::Scalar::all(0));
  Disturb({1.2, 1.0, 0.0, 0.0}, 0, &image);
  EXPECT_EQ(image.at<cv::Vec3b>(25, 25)[0], 120);
  Disturb({}, 0, &same);
  EXPECT_EQ(same.at<cv::Vec3b>(25, 25)[0], 100);
  edge.colRange(25, 50).setTo(cv::Scalar::all(200));
  Disturb({1.0, 1.0, 1.5, 0.0}, 0, &edge);
  EXPECT_GT(edge.at<cv::Vec3b>(25, 24)[0], 40);
}

TEST(WithoutObject, NothingOfTheObjectIsLeft) {
  cv::Mat image(200, 300, CV_8UC3, cv::Scalar(60, 120, 60)), mask(200, 300, CV_8UC1, cv::Scalar(0));
  image(cv::Rect(100, 50, 60, 80)).setTo(cv::Scalar(0, 0, 255));
  mask(cv::Rect(100, 50, 60, 80)).setTo(255);
  EXPECT_EQ(cv::norm(WithoutObject(image, mask), cv::Mat(200, 300, CV_8UC3, cv::Scalar(60, 120, 60)), cv::NORM_INF), 0.0);

  // It fills most of the image: still none of it is left.
  image(cv::Rect(20, 10, 250, 180)).setTo(cv::Scalar(0, 0, 255));
  mask(cv::Rect(20, 10, 250, 180)).setTo(255);
  cv::Mat red;
  cv::inRange(WithoutObject(image, mask), cv::Scalar(0, 0, 200), cv::Scalar(30, 30, 255), red);
  EXPECT_EQ(cv::countNonZero(red), 0);
  EXPECT_EQ(cv::norm(WithoutObject(image, cv::Mat::zeros(200, 300, CV_8UC1)), image, cv::NORM_INF), 0.0);
}

}  // namespace
}  // namespace vantage::assessment
