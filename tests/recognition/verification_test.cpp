#include "recognition/verification.h"

#include <gtest/gtest.h>

#include <limits>

namespace vantage::recognition {
namespace {

const geometry::PinholeCamera kCamera{640, 480, 500, 500, 320, 240};

// A flat square plate of 0.2 m that faces the camera at its pose: 21 x 21 points, one view.
model::ObjectModel Plate(const std::string& name) {
  model::ObjectModel object;
  object.name = name;
  model::View view;
  view.T_camera_object.translation() = Eigen::Vector3d(0, 0, 1);
  for (int y = -10; y <= 10; ++y) {
    for (int x = -10; x <= 10; ++x) {
      view.points.push_back(static_cast<int>(object.points.size()));
      object.points.push_back({Eigen::Vector3d(0.01 * x, 0.01 * y, 0.0), -Eigen::Vector3d::UnitZ()});
    }
  }
  object.views.push_back(view);
  return object;
}

geometry::Rigid At(double x, double y, double z) {
  geometry::Rigid T = geometry::Rigid::Identity();
  T.translation() = Eigen::Vector3d(x, y, z);
  return T;
}

// Explains every `step`-th of the plate's points whose x (object frame) is in the range; interest points are numbered by pixel, so
// that two hypotheses explain the same one where their points coincide.
Hypothesis Explain(const model::ObjectModel& object, const geometry::Rigid& T, int step = 4, double from_x = -1.0,
                   double to_x = 1.0) {
  Hypothesis hypothesis{&object, T, {}, {}, {}};
  for (size_t i = 0; i < object.points.size(); i += step) {
    const Eigen::Vector3d& p = object.points[i].position;
    if (p.x() < from_x || p.x() > to_x) continue;
    const Eigen::Vector2d pixel = *kCamera.Project(T * p);
    hypothesis.keypoints.push_back(1000 * static_cast<int>(std::lround(pixel.y())) + static_cast<int>(std::lround(pixel.x())));
    hypothesis.pixels.push_back(pixel);
    hypothesis.depths_m.push_back((T * p).z());
  }
  return hypothesis;
}

rgbd::Frame FrameOfDepth(int depth_mm) {
  rgbd::Frame frame;
  frame.camera = kCamera;
  frame.depth = cv::Mat(480, 640, CV_16UC1, cv::Scalar(depth_mm));
  return frame;
}

TEST(Depth, TellsSupportedHiddenAndSeenThrough) {
  const model::ObjectModel plate = Plate("plate");
  const int points = static_cast<int>(plate.points.size());
  const DepthEvidence there = CompareDepth(plate, At(0, 0, 1), FrameOfDepth(1010), 0.03);
  EXPECT_EQ(there.supported, points);
  EXPECT_FALSE(IsContradicted(there, {}));
  const DepthEvidence through = CompareDepth(plate, At(0, 0, 1), FrameOfDepth(1500), 0.03);
  EXPECT_EQ(through.seen_through, points);
  EXPECT_TRUE(IsContradicted(through, {}));
  const DepthEvidence hidden = CompareDepth(plate, At(0, 0, 1), FrameOfDepth(700), 0.03);
  EXPECT_EQ(hidden.hidden, points);
  EXPECT_TRUE(IsContradicted(hidden, {})) << "nothing of it is seen";
}

TEST(Depth, AHalfHiddenObjectIsNotContradicted) {
  const model::ObjectModel plate = Plate("plate");
  rgbd::Frame frame = FrameOfDepth(1000);
  frame.depth.colRange(320, 640).setTo(600);
  EXPECT_FALSE(IsContradicted(CompareDepth(plate, At(0, 0, 1), frame, 0.03), {}));
}

TEST(Depth, SaysNothingWhereThereIsNone) {
  const model::ObjectModel plate = Plate("plate");
  EXPECT_FALSE(IsContradicted(CompareDepth(plate, At(0, 0, 1), FrameOfDepth(0), 0.03), {}));
  rgbd::Frame frame = FrameOfDepth(0);
  frame.depth = cv::Mat();
  EXPECT_FALSE(IsContradicted(CompareDepth(plate, At(0, 0, 1), frame, 0.03), {}));
  EXPECT_FALSE(IsContradicted(CompareDepth(plate, At(5, 0, 1), FrameOfDepth(1500), 0.03), {})) << "outside the image";
}

TEST(Conflicts, SeveralInstancesStayAndRepeatedPosesAreOne) {
  const model::ObjectModel plate = Plate("plate");
  const std::vector<Hypothesis> hypotheses = {Explain(plate, At(-0.3, 0, 1), 4, -0.06, 0.06), Explain(plate, At(0.3, 0, 1), 3),
                                              Explain(plate, At(0.305, 0.002, 1.01), 5, -0.06, 0.06)};
  EXPECT_EQ(ResolveConflicts(hypotheses, kCamera, 7, {}), (std::vector<int>{1, 0})) << "what explains more comes first";
  VerificationParams one;
  one.max_instances = 1;
  EXPECT_EQ(ResolveConflicts(hypotheses, kCamera, 7, one), (std::vector<int>{1}));
}

TEST(Conflicts, TheSameInterestPointsBelongToWhatExplainsMore) {
  const model::ObjectModel plate = Plate("plate"), twin = Plate("twin");
  const std::vector<Hypothesis> hypotheses = {Explain(twin, At(0, 0, 1), 4, -0.05, 0.05), Explain(plate, At(0, 0, 1), 4)};
  EXPECT_EQ(ResolveConflicts(hypotheses, kCamera, 7, {}), (std::vector<int>{1}));
}

TEST(Conflicts, AnObjectInFrontOfAnotherStays) {
  const model::ObjectModel plate = Plate("plate"), small = Plate("small");
  // The one in front covers the middle of the one behind, which is matched at its right and left only.
  Hypothesis behind = Explain(plate, At(0, 0, 0.8), 1, 0.06, 1.0);
  const Hypothesis left = Explain(plate, At(0, 0, 0.8), 1, -1.0, -0.06);
  behind.keypoints.insert(behind.keypoints.end(), left.keypoints.begin(), left.keypoints.end());
  behind.pixels.insert(behind.pixels.end(), left.pixels.begin(), left.pixels.end());
  behind.depths_m.insert(behind.depths_m.end(), left.depths_m.begin(), left.depths_m.end());
  model::ObjectModel half = small;
  for (auto& point : half.points) point.position *= 0.4;
  const std::vector<Hypothesis> hypotheses = {behind, Explain(half, At(0, 0, 0.7), 4)};
  EXPECT_EQ(ResolveConflicts(hypotheses, kCamera, 7, {}), (std::vector<int>{0, 1}));
}

TEST(Conflicts, WhatWouldBeSeenThroughAnotherGoes) {
  const model::ObjectModel plate = Plate("plate"), other = Plate("other");
  // Points of its own, but behind what explains more.
  Hypothesis phantom = Explain(other, At(0.02, 0.01, 1.6), 2);
  for (int& keypoint : phantom.keypoints) keypoint += 1000000;
  EXPECT_EQ(ResolveConflicts({phantom, Explain(plate, At(0, 0, 0.8))}, kCamera, 7, {}), (std::vector<int>{1}));
}

TEST(Conflicts, WhatWouldHideABetterOneGoes) {
  const model::ObjectModel plate = Plate("plate"), other = Plate("other");
  // Few points, and its surface would lie before all that the better one explains.
  Hypothesis phantom = Explain(other, At(0, 0, 0.5), 9);
  for (int& keypoint : phantom.keypoints) keypoint += 1000000;
  const std::vector<Hypothesis> hypotheses = {Explain(plate, At(0, 0, 0.8), 2), phantom};
  EXPECT_EQ(ResolveConflicts(hypotheses, kCamera, 7, {}), (std::vector<int>{0}));
}

TEST(Conflicts, NothingInNothingOut) {
  EXPECT_TRUE(ResolveConflicts({}, kCamera, 7, {}).empty());
  const model::ObjectModel plate = Plate("plate");
  EXPECT_TRUE(ResolveConflicts({Explain(plate, At(0, 0, 1), 100)}, kCamera, 7, {}).empty()) << "too few points";
}

TEST(Verification, ParametersAreChecked) {
  VerificationParams params;
  EXPECT_NO_THROW(params.Check());
  params.max_instances = 0;
  EXPECT_THROW(params.Check(), std::invalid_argument);
  params = {};
  params.min_own_share = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(params.Check(), std::invalid_argument);
}

}  // namespace
}  // namespace vantage::recognition
