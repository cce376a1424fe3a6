#include "messaging/learner_messages.h"

#include <gtest/gtest.h>

#include <cmath>

namespace vantage::messaging {
namespace {

TEST(LearnerMessages, TracksSurviveTheWire) {
  Track track;
  track.utime = 11;
  track.sequence = 3;
  track.object = "mug";
  track.result.state = learning::State::kRelocalising;
  track.result.T_camera_object = geometry::Rigid::Identity();
  track.result.T_camera_object->translation().z() = 0.7;
  track.result.confidence = {0.5, 2, 10, 20};
  track.result.probability = 0.9;
  track.result.reference_view = 2;
  track.result.view_added = true;
  track.result.note = "a note";
  track.views = 4;
  const auto back = FromMessage(ToMessage(track));
  ASSERT_TRUE(back) << back.error;
  EXPECT_EQ(back->utime, 11);
  EXPECT_EQ(back->result.state, learning::State::kRelocalising);
  ASSERT_TRUE(back->result.T_camera_object);
  EXPECT_DOUBLE_EQ(back->result.T_camera_object->translation().z(), 0.7);
  EXPECT_FALSE(back->T_world_object);
  EXPECT_TRUE(back->result.view_added);
  EXPECT_EQ(back->result.confidence.support, 10);
  EXPECT_EQ(back->result.note, "a note");
  EXPECT_EQ(back->views, 4);

  auto bad = ToMessage(track);
  bad.state = "dreaming";
  EXPECT_FALSE(FromMessage(bad));
  bad = ToMessage(track);
  bad.probability = std::nan("");
  EXPECT_FALSE(FromMessage(bad));
  bad = ToMessage(track);
  bad.T_camera_object.orientation[0] = 3.0;
  EXPECT_FALSE(FromMessage(bad));
}

TEST(LearnerMessages, ScenesSurviveTheWire) {
  Scene scene;
  scene.utime = 5;
  scene.object = "mug";
  scene.plane = segmentation::Plane{Eigen::Vector3d::UnitZ(), -0.02, 0.5};
  scene.hulls.push_back({"object 0", {{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}, {0, 0, 0.2}}});
  const auto back = FromMessage(ToMessage(scene));
  ASSERT_TRUE(back) << back.error;
  ASSERT_TRUE(back->plane);
  EXPECT_DOUBLE_EQ(back->plane->Height({0.0, 0.0, 1.0}), 0.98);
  ASSERT_EQ(back->hulls.size(), 1u);
  EXPECT_EQ(back->hulls[0].name, "object 0");
  EXPECT_DOUBLE_EQ(back->hulls[0].points_in_world[3].z(), 0.2);

  auto bad = ToMessage(scene);
  bad.plane_normal[2] = 0.0;
  EXPECT_FALSE(FromMessage(bad));
  bad = ToMessage(scene);
  bad.hulls[0].points[1][1] = std::nan("");
  EXPECT_FALSE(FromMessage(bad));
}

TEST(LearnerMessages, ViewsSurviveTheWire) {
  model::ObjectModel object;
  object.name = "mug";
  object.views.emplace_back();
  object.views[0].id = 4;
  object.views[0].utime = 99;
  object.views[0].T_camera_object.translation().z() = 0.8;
  const auto back = FromMessage(ToMessage(NewestView(object, "models.db")));
  ASSERT_TRUE(back) << back.error;
  EXPECT_EQ(back->view_id, 4);
  EXPECT_EQ(back->utime, 99);
  EXPECT_NEAR(back->viewpoint.distance_m, 0.8, 1e-12);
  EXPECT_EQ(back->store, "models.db");
}

TEST(LearnerMessages, DetectionsSurviveTheWire) {
  FrameDetections detections;
  detections.utime = 77;
  detections.objects = 2;
  recognition::Detection detection;
  detection.object = "mug";
  detection.probability = 0.8;
  detection.source = measures::Source::kPooled;
  detections.detections.push_back(detection);
  const auto back = FromMessage(ToMessage(detections));
  ASSERT_TRUE(back) << back.error;
  ASSERT_EQ(back->detections.size(), 1u);
  EXPECT_EQ(back->detections[0].source, measures::Source::kPooled);
  auto bad = ToMessage(detections);
  bad.detections[0].probability = 1.01;
  EXPECT_FALSE(FromMessage(bad));
}

}  // namespace
}  // namespace vantage::messaging
