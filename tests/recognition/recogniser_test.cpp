#include "recognition/recogniser.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <random>

namespace vantage::recognition {
namespace {

const geometry::PinholeCamera kCamera{640, 480, 500, 500, 319.5, 239.5};
constexpr double kDepth_m = 0.5;
constexpr int kSize_px = 180;

// A picture without repetition.
cv::Mat Texture(std::uint32_t seed) {
  std::mt19937 random(seed);
  cv::Mat picture(kSize_px, kSize_px, CV_8UC3, cv::Scalar(128, 128, 128));
  for (int i = 0; i < 250; ++i) {
    const cv::Point at(static_cast<int>(random() % kSize_px), static_cast<int>(random() % kSize_px));
    const int gray = static_cast<int>(random() % 256);
    cv::circle(picture, at, 2 + static_cast<int>(random() % 9), cv::Scalar(gray, gray, gray), cv::FILLED, cv::LINE_AA);
  }
  return picture;
}

// A plate that wears the texture and faces the camera at kDepth_m, its top left pixel at each of the places.
rgbd::Frame FrameWith(const std::vector<std::pair<cv::Mat, cv::Point>>& plates) {
  rgbd::Frame frame;
  frame.camera = kCamera;
  frame.color = cv::Mat(480, 640, CV_8UC3, cv::Scalar(90, 90, 90));
  frame.depth = cv::Mat(480, 640, CV_16UC1, cv::Scalar(900));
  for (const auto& [texture, corner] : plates) {
    const cv::Rect area(corner, texture.size());
    texture.copyTo(frame.color(area));
    frame.depth(area).setTo(static_cast<int>(1000 * kDepth_m));
  }
  return frame;
}

// The plate as learned from one look at it in the middle of the image; the object's frame is that camera's, moved to the plate.
std::shared_ptr<model::ObjectModel> Learned(const std::string& name, const cv::Mat& texture, const RecogniserParams& params) {
  auto object = std::make_shared<model::ObjectModel>();
  object->name = name;
  object->feature_fingerprint = params.features.Fingerprint();
  const cv::Point corner(230, 150);
  model::View view;
  view.keyframe = FrameWith({{texture, corner}});
  view.mask = cv::Mat::zeros(480, 640, CV_8UC1);
  view.mask(cv::Rect(corner, texture.size())).setTo(255);
  view.T_camera_object.translation() = Eigen::Vector3d(0, 0, kDepth_m);
  view.features = features::Extract(rgbd::Gray(view.keyframe), view.mask, params.features);
  for (const cv::KeyPoint& keypoint : view.features.keypoints) {
    view.points.push_back(static_cast<int>(object->points.size()));
    const Eigen::Vector3d in_camera = kCamera.Unproject({keypoint.pt.x, keypoint.pt.y}, kDepth_m);
    object->points.push_back({view.T_camera_object.inverse() * in_camera, -Eigen::Vector3d::UnitZ()});
  }
  object->views.push_back(view);
  return object;
}

std::vector<Detection> Recognise(const Recogniser& recogniser, const rgbd::Frame& frame) {
  return recogniser.Recognise(frame, recogniser.Extract(frame));
}

// Where the plate is with its corner there, as T_camera_object's translation.
Eigen::Vector3d PlaceOf(const cv::Point& corner) {
  return {(corner.x - 230) * kDepth_m / kCamera.fx, (corner.y - 150) * kDepth_m / kCamera.fy, kDepth_m};
}

TEST(Recogniser, NothingKnownNothingFound) {
  const Recogniser recogniser{RecogniserParams{}};
  EXPECT_TRUE(Recognise(recogniser, FrameWith({{Texture(1), {100, 100}}})).empty());
}

TEST(Recogniser, OneObjectFromOneViewWithAndWithoutDepth) {
  Recogniser recogniser{RecogniserParams{}};
  recogniser.Set(Learned("plate", Texture(1), recogniser.params()));
  rgbd::Frame frame = FrameWith({{Texture(1), {60, 200}}});
  for (const bool depth : {true, false}) {
    if (!depth) frame.depth = cv::Mat();
    const auto found = Recognise(recogniser, frame);
    ASSERT_EQ(found.size(), 1u) << depth;
    EXPECT_LT((found[0].T_camera_object.translation() - PlaceOf({60, 200})).norm(), 0.005) << depth;
    EXPECT_GT(found[0].probability, 0.5) << depth;
    EXPECT_GE(static_cast<int>(found[0].inlier_pixels.size()), recogniser.params().min_inliers);
  }
}

// SURF does all that SIFT does; what one learned is of no use to the other, and it is said so.
TEST(Recogniser, WorksOnSurfAndRefusesObjectsOfOtherFeatures) {
  RecogniserParams surf;
  surf.features.type = "surf";
  Recogniser recogniser(surf);
  recogniser.Set(Learned("plate", Texture(1), surf));
  const cv::Point corner(320, 230);
  for (const bool by_tree : {false, true}) {
    if (by_tree) surf.matching.exhaustive_points = 0;
    Recogniser another(surf);
    another.Set(Learned("plate", Texture(1), surf));
    const auto detections = Recognise(another, FrameWith({{Texture(1), corner}}));
    ASSERT_EQ(detections.size(), 1u) << by_tree;
    EXPECT_LT((detections[0].T_camera_object.translation() - PlaceOf(corner)).norm(), 0.003);
  }
  try {
    recogniser.Set(Learned("other", Texture(2), RecogniserParams{}));
    FAIL() << "an object of SIFT was taken";
  } catch (const std::invalid_argument& error) {
    for (const char* part : {"other", "sift", "surf", "learn it again"}) {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << "no " << part << " in: " << error.what();
    }
  }
  EXPECT_NE(surf.Fingerprint(), RecogniserParams{}.Fingerprint()) << "a fitted measure holds for one of them";
}

TEST(Recogniser, FindsSeveralObjectsAndSeveralInstancesOfOne) {
  Recogniser recogniser{RecogniserParams{}};
  recogniser.Set(Learned("a", Texture(1), recogniser.params()));
  recogniser.Set(Learned("b", Texture(2), recogniser.params()));
  const rgbd::Frame frame = FrameWith({{Texture(1), {20, 20}}, {Texture(1), {240, 280}}, {Texture(2), {420, 40}}});
  int a = 0, b = 0;
  for (const Detection& detection : Recognise(recogniser, frame)) {
    const Eigen::Vector3d at = detection.T_camera_object.translation();
    if (detection.object == "b") {
      ++b;
      EXPECT_LT((at - PlaceOf({420, 40})).norm(), 0.005);
    } else {
      ++a;
      EXPECT_LT(std::min((at - PlaceOf({20, 20})).norm(), (at - PlaceOf({240, 280})).norm()), 0.005);
    }
  }
  EXPECT_EQ(a, 2);
  EXPECT_EQ(b, 1);
}

TEST(Recogniser, APictureOfTheObjectAtTheWrongDepthIsNotTheObject) {
  Recogniser recogniser{RecogniserParams{}};
  recogniser.Set(Learned("plate", Texture(1), recogniser.params()));
  rgbd::Frame frame = FrameWith({{Texture(1), {200, 100}}});
  frame.depth.setTo(900);  // A poster, twice as large, further away.
  EXPECT_TRUE(Recognise(recogniser, frame).empty());
}

TEST(Recogniser, AnObjectThatIsNotThereIsNotFoundSurely) {
  Recogniser recogniser{RecogniserParams{}};
  recogniser.Set(Learned("plate", Texture(1), recogniser.params()));
  for (const Detection& detection : Recognise(recogniser, FrameWith({{Texture(5), {200, 100}}}))) {
    EXPECT_LT(detection.probability, 0.5);
  }
}

TEST(Recogniser, PicturesThatShowNothingAreAnEmptyResult) {
  Recogniser recogniser{RecogniserParams{}};
  recogniser.Set(Learned("plate", Texture(1), recogniser.params()));
  rgbd::Frame black = FrameWith({});
  black.color.setTo(0);
  EXPECT_TRUE(Recognise(recogniser, black).empty());
  black.depth.setTo(0);
  EXPECT_TRUE(Recognise(recogniser, black).empty());
  black.depth = cv::Mat();
  EXPECT_TRUE(Recognise(recogniser, black).empty());
}

TEST(Recogniser, ObjectsWithoutViewsOrPointsAreNeverFound) {
  Recogniser recogniser{RecogniserParams{}};
  auto empty = std::make_shared<model::ObjectModel>();
  empty->name = "empty";
  empty->feature_fingerprint = recogniser.params().features.Fingerprint();
  recogniser.Set(empty);
  auto blank = std::make_shared<model::ObjectModel>(*Learned("blank", Texture(1), recogniser.params()));
  blank->points.clear();
  blank->views[0].points.clear();
  blank->views[0].features = features::Features();
  recogniser.Set(blank);
  EXPECT_EQ(recogniser.size(), 2);
  EXPECT_TRUE(Recognise(recogniser, FrameWith({{Texture(1), {100, 100}}})).empty());
  recogniser.Remove("empty");
  recogniser.Remove("blank");
  recogniser.Remove("never there");
  EXPECT_EQ(recogniser.size(), 0);
}

TEST(Recogniser, MeasuresOfOtherSettingsAreNotUsedButThoseOfOtherObjects) {
  const RecogniserParams params;
  Recogniser recogniser(params);
  const measures::ObservedSuccess own({0.5, 0.1, 100}, {0.1, 0.05, 100}, measures::Source::kOwn);
  const auto with = [&](const std::string& name, int texture, const std::string& fingerprint) {
    auto object = Learned(name, Texture(texture), params);
    object->measures.observed = own;
    object->measures.fingerprint = fingerprint;
    return object;
  };
  const auto old = with("old", 1, "other settings");
  EXPECT_NE(MeasuresMismatch(*old, params).find("'old'"), std::string::npos);
  EXPECT_EQ(MeasuresMismatch(*Learned("new", Texture(1), params), params), "");
  recogniser.Set(old);
  const auto source = [&] { return Recognise(recogniser, FrameWith({{Texture(1), {60, 200}}})).at(0).source; };
  EXPECT_EQ(source(), measures::Source::kDefault);
  recogniser.Set(with("other", 2, params.Fingerprint()));
  EXPECT_EQ(source(), measures::Source::kPooled);
  EXPECT_NEAR(recogniser.Pooled().positive().mean, 0.5, 1e-12);
  recogniser.Set(with("old", 1, params.Fingerprint()));
  EXPECT_EQ(source(), measures::Source::kOwn);
  recogniser.Remove("other");
  recogniser.Remove("old");
  EXPECT_EQ(recogniser.Pooled().source(), measures::Source::kDefault);
}

TEST(Recogniser, IsTheSameOnEveryRun) {
  Recogniser recogniser{RecogniserParams{}};
  recogniser.Set(Learned("plate", Texture(1), recogniser.params()));
  const rgbd::Frame frame = FrameWith({{Texture(1), {60, 200}}});
  const auto first = Recognise(recogniser, frame), second = Recognise(recogniser, frame);
  ASSERT_EQ(first.size(), second.size());
  for (size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(first[i].T_camera_object.matrix(), second[i].T_camera_object.matrix());
  }
}

}  // namespace
}  // namespace vantage::recognition
