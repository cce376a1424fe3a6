#include "assessment/held_out.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "assessment/board.h"

namespace vantage::assessment {
namespace {

constexpr double kDegree = M_PI / 180.0;

HeldOutFrame FrameAt(double distance_m) {
  HeldOutFrame frame;
  frame.T_camera_mesh = geometry::Rigid(Eigen::Translation3d(0.0, 0.0, distance_m));
  frame.counts = true;
  return frame;
}

TEST(Truth, RightIsNearTheTruePoseInTheObjectsOwnFrame) {
  Truth truth;
  truth.points_in_mesh = Eigen::Matrix3Xd::Identity(3, 3) * 0.1;
  truth.T_mesh_object = geometry::Rigid(Eigen::Translation3d(0.5, 0.0, 0.0));
  const HeldOutFrame frame = FrameAt(1.0);
  const geometry::Rigid T_camera_object = *frame.T_camera_mesh * truth.T_mesh_object;
  EXPECT_TRUE(truth.IsRight(T_camera_object, frame));
  EXPECT_TRUE(truth.IsRight(Eigen::Translation3d(0.0, 0.039, 0.0) * T_camera_object, frame));
  EXPECT_FALSE(truth.IsRight(Eigen::Translation3d(0.0, 0.041, 0.0) * T_camera_object, frame));
  EXPECT_FALSE(truth.IsRight(*frame.T_camera_mesh, frame));
  EXPECT_FALSE(truth.IsRight(T_camera_object, HeldOutFrame()));  // Whatever is found where the object is not is wrong.
}

TEST(Truth, TheErrorIsByAxisOfTheCamera) {
  Truth truth;
  truth.points_in_mesh = Eigen::Matrix3Xd::Random(3, 40) * 0.1;
  truth.T_mesh_object = geometry::Rigid(Eigen::Translation3d(0.5, 0.0, 0.0));
  const HeldOutFrame frame = FrameAt(1.0);
  const geometry::Rigid T_camera_object = Eigen::Translation3d(0.01, -0.02, 0.03) * *frame.T_camera_mesh * truth.T_mesh_object;
  EXPECT_LT((truth.ErrorByAxis(T_camera_object, frame) - Eigen::Vector3d(0.01, 0.02, 0.03)).norm(), 1e-9);
  EXPECT_THROW(truth.ErrorByAxis(T_camera_object, HeldOutFrame()), std::logic_error);
}

TEST(Looks, AreTheFramesThatCountDetectedWhereTheMostLikelyHypothesisIsRightAndBelieved) {
  std::vector<HeldOutFrame> frames(5, FrameAt(1.0));
  frames[1] = FrameAt(0.5);
  frames[4].counts = false;
  model::ObjectModel object;
  object.views.emplace_back();
  object.views[0].T_camera_object = *frames[0].T_camera_mesh;
  object.measures.observed = {{0.6, 0.1, 50}, {0.2, 0.1, 50}, measures::Source::kOwn};  // 1/2 at 0.4.
  const std::vector<HeldOutHypothesis> hypotheses = {
      {0, 0.7, true},                   // Detected.
      {1, 0.3, true},                   // Right, not believed.
      {2, 0.8, false}, {2, 0.7, true},  // The wrong one is the more likely.
      {4, 0.7, true},                   // Does not count; frame 3 has none.
  };
  const auto looks = Looks(object, hypotheses, frames, Truth());
  ASSERT_EQ(looks.size(), 4u);
  for (std::size_t i = 0; i < looks.size(); ++i) EXPECT_EQ(looks[i].detected, i == 0);
  const auto max = [&](std::size_t i) { return looks[i].predicted.Value(measures::CompletenessRule::kMax, 0.5); };
  EXPECT_NEAR(max(0), object.measures.predicted.Probability(0.0), 1e-9);
  EXPECT_NEAR(max(1), object.measures.predicted.Probability(0.0, 1.0), 1e-9);
  EXPECT_TRUE(Looks(object, {}, {}, Truth()).empty());
}

TEST(HeldOut, ViewsOfTheBoxAreFoundInPhotographsBesideThemAndNotFromBehind) {
  VANTAGE_NEEDS_DATA("board");
  const vantage::testing::Board board;
  const recognition::RecogniserParams recogniser;
  auto object = std::make_shared<model::ObjectModel>();
  for (const int id : {0, 80}) ASSERT_TRUE(board.AddView(id, recogniser.features, object.get()));
  Truth truth;
  truth.points_in_mesh = object->PointMatrix();
  std::vector<HeldOutFrame> frames;
  for (const int id : {1, 31, 79, 111}) {
    HeldOutFrame held_out;
    held_out.frame = board.scene.Load(id);
    held_out.frame.depth = cv::Mat();
    held_out.features = recognition::Recogniser(recogniser).Extract(held_out.frame);
    held_out.T_camera_mesh = board.TruePose(id);
    held_out.counts = held_out.T_camera_mesh.has_value();
    frames.push_back(std::move(held_out));
  }
  const std::vector<ViewTrial> alone = TryViewsAlone(*object, truth, frames, recogniser);
  int near = 0, near_right = 0;
  std::vector<bool> found(frames.size(), false);
  for (const ViewTrial& trial : alone) {
    EXPECT_LT(trial.rotation_rad, M_PI_2);
    EXPECT_LT(std::abs(trial.log2_scale), 2.0);
    if (trial.right) found[static_cast<std::size_t>(trial.frame)] = true;
    if (trial.rotation_rad < 15.0 * kDegree) near += 1, near_right += trial.right;
    EXPECT_FALSE(trial.right && trial.rotation_rad > 75.0 * kDegree);
  }
  EXPECT_EQ(near_right, near);
  // What one view finds, both together find.
  std::vector<bool> found_together(frames.size(), false);
  int last = 0;
  for (const HeldOutHypothesis& hypothesis : Hypotheses(object, truth, frames, recogniser)) {
    EXPECT_GE(hypothesis.frame, last);
    last = hypothesis.frame;
    if (hypothesis.right) found_together[static_cast<std::size_t>(hypothesis.frame)] = true;
  }
  EXPECT_EQ(found_together, found);
  EXPECT_GE(std::count(found.begin(), found.end(), true), 1);
}

}  // namespace
}  // namespace vantage::assessment
