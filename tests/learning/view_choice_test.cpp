// Which frames become views.
#include "learning/view_choice.h"

#include <gtest/gtest.h>

#include <cmath>

namespace vantage::learning {
namespace {

constexpr double kDistance_m = 0.8;

// The camera at `azimuth_deg` around the object's z axis, at its height, looking at it.
geometry::Rigid PoseFrom(double azimuth_deg, double distance_m = kDistance_m) {
  const double azimuth_rad = azimuth_deg * M_PI / 180.0;
  const Eigen::Vector3d outward(std::cos(azimuth_rad), std::sin(azimuth_rad), 0.0);
  geometry::Rigid T_object_camera = geometry::Rigid::Identity();
  T_object_camera.linear().col(2) = -outward;
  T_object_camera.linear().col(1) = -Eigen::Vector3d::UnitZ();
  T_object_camera.linear().col(0) = T_object_camera.linear().col(1).cross(T_object_camera.linear().col(2));
  T_object_camera.translation() = distance_m * outward;
  return T_object_camera.inverse();
}

// A view every 30 degrees from 0 on, each with 20 points of its own.
model::ObjectModel ViewsAround(int count) {
  model::ObjectModel object;
  for (int v = 0; v < count; ++v) {
    model::View view;
    view.id = v;
    view.T_camera_object = PoseFrom(30.0 * v);
    for (int k = 0; k < 20; ++k) {
      view.points.push_back(static_cast<int>(object.points.size()));
      object.points.push_back({Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitX()});
    }
    object.views.push_back(view);
  }
  return object;
}

// Tracked from there, surely and firmly, but little of it recognised.
Track TrackedFrom(double azimuth_deg, const LearnerParams& params = {}) {
  Track track;
  track.T_camera_object = PoseFrom(azimuth_deg);
  track.matches.resize(params.min_links);
  track.confidence.value = 0.9 * params.new_view_confidence;
  track.confidence.view = 0;
  track.probability = 0.99;
  track.spread.sigma_m = 0.5 * params.max_spread_m;
  track.spread.sigma_rad = 0.5 * params.max_spread_deg * M_PI / 180.0;
  return track;
}

TEST(HoldOf, FirmWherePointsHoldIt) {
  const LearnerParams params;
  Track track = TrackedFrom(0.0);
  EXPECT_EQ(HoldOf({track}, params), Hold::kFirm);
  track.matches.resize(params.min_links - 1);
  EXPECT_EQ(HoldOf({track}, params), Hold::kNone);
  EXPECT_EQ(HoldOf({track, true}, params), Hold::kPlain);
}

TEST(HoldOf, PlainUpToItsOwnSpread) {
  const LearnerParams params;
  Track track = TrackedFrom(0.0);
  track.spread.sigma_rad = 0.5 * (params.max_spread_deg + params.max_plain_spread_deg) * M_PI / 180.0;
  EXPECT_EQ(HoldOf({track}, params), Hold::kNone);
  EXPECT_EQ(HoldOf({track, true}, params), Hold::kPlain);
  track.spread.sigma_rad = 1.1 * params.max_plain_spread_deg * M_PI / 180.0;
  EXPECT_EQ(HoldOf({track, true}, params), Hold::kNone);
}

TEST(HoldOf, ABlurredPictureIsNoPlainSide) {
  const LearnerParams params;
  Track track = TrackedFrom(0.0);
  track.matches.clear();
  track.confidence.visible = 100;
  track.confidence.value = 0.5 * params.min_plain_confidence;
  EXPECT_EQ(HoldOf({track, true}, params), Hold::kNone);
  track.confidence.value = 1.5 * params.min_plain_confidence;
  EXPECT_EQ(HoldOf({track, true}, params), Hold::kPlain);
  track.confidence.visible = 0;  // Nothing ought to be seen.
  track.confidence.value = 0.0;
  EXPECT_EQ(HoldOf({track, true}, params), Hold::kPlain);
}

TEST(HoldOf, WhatLooksOtherwiseIsNotHeldUnlessTheMountSaysSo) {
  const LearnerParams params;
  Track track = TrackedFrom(0.0);
  track.likeness = params.min_likeness - 0.05;
  EXPECT_EQ(HoldOf({track, true}, params), Hold::kNone);
  EXPECT_EQ(HoldOf({track, false, true}, params), Hold::kFirm);
}

TEST(IsNewDirection, TheLessIsRecognisedTheNearerItMayBe) {
  const LearnerParams params;
  const model::ObjectModel object = ViewsAround(1);
  Track track = TrackedFrom(0.7 * params.min_view_angle_deg);
  EXPECT_FALSE(IsNewDirection(object, track, Hold::kFirm, params));
  track.confidence.value = 0.0;
  EXPECT_TRUE(IsNewDirection(object, track, Hold::kFirm, params));
  EXPECT_FALSE(IsNewDirection(object, track, Hold::kPlain, params));
}

TEST(IsNewDirection, AnotherDistanceIsNew) {
  const LearnerParams params;
  Track track = TrackedFrom(0.0);
  track.T_camera_object = PoseFrom(0.0, 1.3 * kDistance_m);
  EXPECT_TRUE(IsNewDirection(ViewsAround(1), track, Hold::kPlain, params));
  track.T_camera_object = PoseFrom(0.0, 1.2 * kDistance_m);
  EXPECT_FALSE(IsNewDirection(ViewsAround(1), track, Hold::kPlain, params));
}

TEST(ClosesLoop, WhereNewestAndOldMeetUnknownToTheModel) {
  const LearnerParams params;
  model::ObjectModel object = ViewsAround(12);  // The newest at 330 degrees.
  const Track track = TrackedFrom(345.0);
  EXPECT_TRUE(ClosesLoop(object, track, params));
  // Too far from the newest.
  EXPECT_FALSE(ClosesLoop(object, TrackedFrom(0.0), params));
  // Seen again right away is no loop.
  EXPECT_FALSE(ClosesLoop(ViewsAround(params.loop_closure.min_views_between + 1), track, params));
  // The model knows already.
  for (int k = 0; k < params.refinement.min_shared_points; ++k) object.views.back().points[k] = object.views.front().points[k];
  EXPECT_FALSE(ClosesLoop(object, track, params));
}

TEST(ChooseView, SaysWhyNot) {
  const LearnerParams params;
  const model::ObjectModel object = ViewsAround(1);
  Track track = TrackedFrom(15.0);
  EXPECT_EQ(ChooseView(object, {track}, params).refusal, "");
  EXPECT_EQ(ChooseView(object, {track}, params).min_points, params.min_view_points);
  track.confidence.value = params.new_view_confidence;
  EXPECT_EQ(ChooseView(object, {track}, params).refusal, "well known from here");
  track = TrackedFrom(15.0);
  track.probability = params.min_track_probability - 0.01;
  EXPECT_EQ(ChooseView(object, {track}, params).refusal, "not sure enough to learn");
  track = TrackedFrom(15.0);
  track.spread.sigma_m = 2.0 * params.max_spread_m;
  EXPECT_EQ(ChooseView(object, {track, true}, params).refusal, "the pose is not held well enough to learn");
  track = TrackedFrom(4.0);
  EXPECT_EQ(ChooseView(object, {track}, params).refusal, "too near to a learned view");
}

TEST(ChooseView, APlainSideMayHaveNoPoints) {
  const LearnerParams params;
  Track track = TrackedFrom(15.0);
  track.matches.clear();
  const ViewChoice choice = ChooseView(ViewsAround(1), {track, true}, params);
  EXPECT_EQ(choice.refusal, "");
  EXPECT_EQ(choice.min_points, 0);
}

TEST(ChooseView, ALoopIsClosedWhereEverythingIsWellKnown) {
  const LearnerParams params;
  Track track = TrackedFrom(340.0);
  track.confidence.value = 1.0;
  EXPECT_EQ(ChooseView(ViewsAround(12), {track}, params).refusal, "");
  EXPECT_EQ(ChooseView(ViewsAround(1), {track}, params).refusal, "well known from here");
}

TEST(ChooseView, AKnownPoseAsksOnlyWhetherItIsKnownFromHere) {
  const LearnerParams params;
  Track track = TrackedFrom(4.0);
  track.probability = 0.0;
  track.matches.clear();
  EXPECT_EQ(ChooseView(ViewsAround(1), {track, false, false, true}, params).refusal, "");
  track.confidence.value = 1.0;
  EXPECT_EQ(ChooseView(ViewsAround(1), {track, false, false, true}, params).refusal, "well known from here");
}

}  // namespace
}  // namespace vantage::learning
