// Object models of random content, and whether two are the same.
#pragma once

#include <gtest/gtest.h>

#include <random>
#include <string>

#include "measures/text.h"
#include "model/object_model.h"

namespace vantage::model {

inline constexpr std::uint32_t kSeed = 7;

inline geometry::Rigid RandomPose(std::mt19937& random) {
  geometry::Rigid pose = geometry::Rigid::Identity();
  pose.translate(Eigen::Vector3d(random() * 1e-9, random() * 1e-9, 0.5));
  pose.rotate(Eigen::AngleAxisd(random() * 1e-9, Eigen::Vector3d(1, 2, 3).normalized()));
  return pose;
}

inline cv::Mat RandomImage(int type, std::mt19937& random) {
  cv::Mat image(48, 64, type);
  for (std::size_t i = 0; i < image.total() * image.elemSize(); ++i) image.data[i] = static_cast<unsigned char>(random());
  return image;
}

// Appends a view of random content with new points, and moves the points there were.
inline void GrowModel(ObjectModel& model, std::mt19937& random, int count = 30) {
  for (ModelPoint& point : model.points) point.position.x() += 1e-3;
  View view;
  view.id = model.views.empty() ? 0 : model.views.back().id + 1;
  view.utime = 1000 + view.id;
  view.frame_id = 10 + view.id;
  view.T_camera_object = RandomPose(random);
  view.keyframe.utime = view.utime;
  view.keyframe.id = view.frame_id;
  view.keyframe.color = RandomImage(CV_8UC3, random);
  view.keyframe.depth = RandomImage(CV_16UC1, random);
  view.keyframe.camera = {64, 48, 500.1, 501.2, 31.3, 23.4};
  if (view.id % 2 == 0) view.keyframe.T_world_camera = RandomPose(random);
  view.mask = RandomImage(CV_8UC1, random);
  view.features.descriptors = cv::Mat(count, 128, CV_32F);
  for (int i = 0; i < count; ++i) {
    view.features.keypoints.emplace_back(random() * 1e-8f, random() * 1e-8f, 3.5f, 77.7f, 0.01f, 4 + (i << 8), i % 3 - 1);
    for (int j = 0; j < 128; ++j) view.features.descriptors.at<float>(i, j) = random() * 1e-10f;
    view.points.push_back(static_cast<int>(model.points.size()));
    model.points.push_back({Eigen::Vector3d(random() * 1e-10, 0.1, -0.2), Eigen::Vector3d::UnitZ()});
  }
  model.views.push_back(view);
}

inline ObjectModel RandomModel(const std::string& name, int views, std::uint32_t seed = kSeed) {
  std::mt19937 random(seed);
  ObjectModel model;
  model.name = name;
  model.feature_fingerprint = "sift 3000";
  for (int i = 0; i < views; ++i) GrowModel(model, random);
  return model;
}

inline bool SameImage(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && (a.empty() || (a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0));
}

inline void ExpectSame(const ObjectModel& a, const ObjectModel& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.feature_fingerprint, b.feature_fingerprint);
  EXPECT_EQ(measures::ToText(a.measures), measures::ToText(b.measures));
  ASSERT_EQ(a.points.size(), b.points.size());
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    ASSERT_EQ(a.points[i].position, b.points[i].position) << "point " << i;
    ASSERT_EQ(a.points[i].normal, b.points[i].normal) << "point " << i;
  }
  ASSERT_EQ(a.views.size(), b.views.size());
  for (std::size_t i = 0; i < a.views.size(); ++i) {
    SCOPED_TRACE("view " + std::to_string(i));
    const View& v = a.views[i];
    const View& w = b.views[i];
    EXPECT_EQ(v.id, w.id);
    EXPECT_EQ(v.utime, w.utime);
    EXPECT_EQ(v.frame_id, w.frame_id);
    EXPECT_EQ(v.keyframe.utime, w.keyframe.utime);
    EXPECT_EQ(v.keyframe.id, w.keyframe.id);
    EXPECT_EQ(v.T_camera_object.matrix(), w.T_camera_object.matrix());
    EXPECT_TRUE(v.keyframe.camera == w.keyframe.camera);
    ASSERT_EQ(v.keyframe.T_world_camera.has_value(), w.keyframe.T_world_camera.has_value());
    if (v.keyframe.T_world_camera) {
      EXPECT_EQ(v.keyframe.T_world_camera->matrix(), w.keyframe.T_world_camera->matrix());
    }
    EXPECT_TRUE(SameImage(v.keyframe.color, w.keyframe.color));
    EXPECT_TRUE(SameImage(v.keyframe.depth, w.keyframe.depth));
    EXPECT_TRUE(SameImage(v.mask, w.mask));
    EXPECT_TRUE(SameImage(v.features.descriptors, w.features.descriptors));
    EXPECT_EQ(v.points, w.points);
    ASSERT_EQ(v.features.size(), w.features.size());
    for (int k = 0; k < v.features.size(); ++k) {
      const cv::KeyPoint& p = v.features.keypoints[static_cast<std::size_t>(k)];
      const cv::KeyPoint& q = w.features.keypoints[static_cast<std::size_t>(k)];
      ASSERT_TRUE(p.pt == q.pt && p.size == q.size && p.angle == q.angle && p.response == q.response && p.octave == q.octave &&
                  p.class_id == q.class_id)
          << "keypoint " << k;
    }
  }
}

}  // namespace vantage::model
