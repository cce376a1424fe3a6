// The learner and the recogniser on real recordings.
#include "learning/learner.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "rgbd/bop.h"
#include "support/data.h"

namespace vantage::learning {
namespace {

// The shelf_box recording's frames without the recording's poses: the learner tracks on its own.
std::vector<rgbd::Frame> ShelfFrames(int count) {
  const rgbd::BopScene scene(testing::DataFolder() / "shelf_box");
  std::vector<rgbd::Frame> frames;
  for (int i = 0; i < count; ++i) {
    frames.push_back(scene.Load(scene.ids()[i]));
  }
  return frames;
}

rgbd::Frame WithoutPose(rgbd::Frame frame) {
  frame.T_world_camera.reset();
  return frame;
}

TEST(Learner, TracksARealObjectAndAgreesWithTheCamerasMotion) {
  VANTAGE_NEEDS_DATA("shelf_box");
  const auto frames = ShelfFrames(8);
  Learner learner(LearnerParams{}, "carton");
  const LearnerResult first = learner.Process(WithoutPose(frames[0]));
  ASSERT_TRUE(first.view_added) << first.note;
  EXPECT_GT(learner.object()->points.size(), 50u);
  for (size_t i = 1; i < frames.size(); ++i) {
    const LearnerResult result = learner.Process(WithoutPose(frames[i]));
    ASSERT_EQ(result.state, State::kTracking) << "frame " << i << ": " << result.note;
    const geometry::Rigid expected = frames[i].T_world_camera->inverse() * *frames[0].T_world_camera * *first.T_camera_object;
    EXPECT_LT(geometry::Difference(*result.T_camera_object, expected).translation_m, 0.015);
    EXPECT_GE(result.probability, 0.5);
  }
}

TEST(Learner, LosesACoveredObjectLearnsNothingAndFindsItAgain) {
  VANTAGE_NEEDS_DATA("shelf_box");
  const auto frames = ShelfFrames(4);
  Learner learner(LearnerParams{}, "carton");
  learner.Process(WithoutPose(frames[0]));
  learner.Process(WithoutPose(frames[1]));
  const size_t views = learner.object()->views.size();
  rgbd::Frame covered = WithoutPose(frames[2]);
  covered.color = cv::Mat::zeros(covered.color.size(), CV_8UC3);
  covered.depth = cv::Mat::zeros(covered.depth.size(), CV_16UC1);
  for (int i = 0; i < 2; ++i) {
    const LearnerResult result = learner.Process(covered);
    EXPECT_TRUE(result.state == State::kRelocalising || result.state == State::kLost);
    EXPECT_FALSE(result.T_camera_object.has_value());
    EXPECT_FALSE(result.note.empty());
  }
  EXPECT_EQ(learner.object()->views.size(), views);
  EXPECT_EQ(learner.Process(WithoutPose(frames[3])).state, State::kTracking);
}

// It is sought first about where it was, but not only there.
TEST(Learner, FindsAgainWhatReturnsElsewhereInTheImage) {
  VANTAGE_NEEDS_DATA("shelf_box");
  const auto frames = ShelfFrames(3);
  Learner learner(LearnerParams{}, "carton");
  learner.Process(WithoutPose(frames[0]));
  learner.Process(WithoutPose(frames[1]));
  rgbd::Frame turned = WithoutPose(frames[2]);  // The camera on its head: what was on the left is on the right.
  turned.color = turned.depth = cv::Mat();      // Not those of frames[2].
  const geometry::PinholeCamera& camera = turned.camera;
  const cv::Matx23d half_turn(-1.0, 0.0, 2.0 * camera.cx, 0.0, -1.0, 2.0 * camera.cy);
  cv::warpAffine(frames[2].color, turned.color, half_turn, frames[2].color.size(), cv::INTER_NEAREST);
  cv::warpAffine(frames[2].depth, turned.depth, half_turn, frames[2].depth.size(), cv::INTER_NEAREST);
  const LearnerResult result = learner.Process(WithoutPose(frames[2]));
  ASSERT_TRUE(result.T_camera_object) << result.note;
  const geometry::Rigid before = *result.T_camera_object;
  ASSERT_LT(camera.Project(before.translation())->x(), camera.cx - 100.0);
  std::optional<geometry::Rigid> found;
  for (int i = 0; i < 3 && !found; ++i) found = learner.Process(turned).T_camera_object;
  ASSERT_TRUE(found);
  const geometry::Rigid expected(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitZ()) * before);
  EXPECT_LT(geometry::Difference(*found, expected).translation_m, 0.005);
}

TEST(Learner, RefusesATrackThatContradictsTheMount) {
  VANTAGE_NEEDS_DATA("shelf_box");
  auto frames = ShelfFrames(3);
  Learner learner(LearnerParams{}, "carton");
  learner.Process(frames[0]);
  ASSERT_TRUE(learner.T_world_object().has_value());
  EXPECT_EQ(learner.Process(frames[1]).state, State::kTracking);
  frames[2].T_world_camera->translation() += Eigen::Vector3d(0.1, 0, 0);  // The object was moved, or the mount is wrong.
  const LearnerResult result = learner.Process(frames[2]);
  EXPECT_NE(result.state, State::kTracking);
  EXPECT_NE(result.note.find("mount"), std::string::npos) << result.note;
}

// Found again and again in another place, and its own seen empty, the object was moved: it is tracked there.
TEST(Learner, AnObjectThatWasMovedIsTrackedWhereItIs) {
  VANTAGE_NEEDS_DATA("shelf_box");
  auto frames = ShelfFrames(12);
  LearnerParams params;
  params.moved_frames = 4;
  Learner learner(params, "carton");
  for (int i = 0; i < 3; ++i) ASSERT_EQ(learner.Process(frames[i]).state, State::kTracking) << i;
  const geometry::Rigid before = *learner.T_world_object();
  const Eigen::Vector3d moved_m = frames[3].T_world_camera->linear() * Eigen::Vector3d(0.0, 0.0, 0.15);
  std::vector<bool> found;
  for (int i = 3; i < 12; ++i) {
    frames[i].T_world_camera->pretranslate(moved_m);  // As if the camera had gone after a box that was pushed away.
    found.push_back(learner.Process(frames[i]).T_camera_object.has_value());
  }
  EXPECT_EQ(found, (std::vector<bool>{false, false, false, true, true, true, true, true, true}));
  const geometry::Rigid after = *learner.T_world_object();
  EXPECT_LT((after.translation() - before.translation() - moved_m).norm(), 0.02);
}

TEST(Learner, LearnsOnlyFromAPoseThatIsHeld) {
  VANTAGE_NEEDS_DATA("shelf_box");
  const auto frames = ShelfFrames(10);
  const auto views_with = [&](const LearnerParams& params) {
    Learner learner(params, "carton");
    for (const rgbd::Frame& frame : frames) {
      const LearnerResult result = learner.Process(WithoutPose(frame));
      if (!result.T_camera_object || result.confidence.value >= 1.0) continue;
      EXPECT_GT(result.spread.sigma_m, 0.0);
      EXPECT_GT(result.likeness.value_or(0.0), 0.5);
    }
    return learner.object()->views.size();
  };
  LearnerParams params;
  params.new_view_confidence = 0.95;
  params.min_view_angle_deg = 2.0;
  const size_t held = views_with(params);
  EXPECT_GT(held, 1u);
  const auto but = [&](auto change) {
    LearnerParams changed = params;
    change(&changed);
    return views_with(changed);
  };
  EXPECT_EQ(but([](LearnerParams* p) { p->max_spread_m = 1e-6; }), 1u);
  EXPECT_EQ(but([](LearnerParams* p) { p->min_likeness = 1.0; }), 1u);
  EXPECT_LT(but([](LearnerParams* p) {
              p->min_links = 10000;
              p->min_surface_agreement = 1.0;
            }),
            held);
}

TEST(Learner, ContinuesAKnownModelWithoutANewOne) {
  VANTAGE_NEEDS_DATA("shelf_box");
  const auto frames = ShelfFrames(3);
  Learner first(LearnerParams{}, "carton");
  first.Process(WithoutPose(frames[0]));
  Learner second(LearnerParams{}, "carton", first.object());
  const LearnerResult result = second.Process(WithoutPose(frames[2]));
  EXPECT_EQ(result.state, State::kTracking) << result.note;
  EXPECT_GE(second.object()->views.size(), first.object()->views.size());
}

TEST(Learner, AnObjectMetBeforeIsContinuedAndHasNoTwin) {
  VANTAGE_NEEDS_DATA("shelf_box");
  const auto frames = ShelfFrames(3);
  Learner first(LearnerParams{}, "carton");
  first.Process(WithoutPose(frames[0]));
  Learner second(LearnerParams{}, "another");
  second.SetOthers({first.object()});
  const LearnerResult result = second.Process(WithoutPose(frames[1]), {Eigen::Vector2d(200, 320)});
  EXPECT_EQ(second.name(), "carton");
  EXPECT_TRUE(result.T_camera_object.has_value()) << result.note;
  ASSERT_NE(second.object(), nullptr);
  EXPECT_EQ(second.object()->views[0].utime, first.object()->views[0].utime);
}

TEST(Learner, ANewObjectIsJudgedByWhatHoldsForOthersUntilItHasItsOwn) {
  VANTAGE_NEEDS_DATA("shelf_box");
  const LearnerParams params;
  auto other = std::make_shared<model::ObjectModel>();
  other->name = "other";
  other->feature_fingerprint = params.recogniser.features.Fingerprint();
  other->measures.observed = {{0.5, 0.1, 100}, {0.1, 0.05, 100}, measures::Source::kOwn};
  other->measures.fingerprint = params.recogniser.Fingerprint();
  Learner learner(params, "carton");
  learner.SetOthers({other});
  learner.Process(WithoutPose(ShelfFrames(1)[0]));
  ASSERT_NE(learner.object(), nullptr);
  EXPECT_EQ(learner.object()->measures.observed.source(), measures::Source::kPooled);
  EXPECT_NEAR(learner.object()->measures.observed.positive().mean, 0.5, 1e-9);
}

// What was found again by recognition alone is learned from only when it is sure, or the next frames have confirmed it.
TEST(Learner, ConfirmsWhatItFoundAgainBeforeItLearns) {
  VANTAGE_NEEDS_DATA("shelf_box");
  const auto frames = ShelfFrames(8);
  Learner teacher(LearnerParams{}, "carton");
  teacher.Process(WithoutPose(frames[0]));
  LearnerParams params;
  params.sure_probability = 0.999999;  // Recognition alone is never sure.
  params.confirm_frames = 2;
  params.min_view_angle_deg = 0.0;  // Every frame would be learned.
  params.new_view_confidence = 0.999;
  Learner learner(params, "carton", teacher.object());
  const size_t views = learner.object()->views.size();
  std::vector<State> states;
  for (int i = 2; i < 6; ++i) {
    const LearnerResult result = learner.Process(WithoutPose(frames[i]));
    ASSERT_TRUE(result.T_camera_object) << "frame " << i << ": " << result.note;
    states.push_back(result.state);
    if (result.state == State::kRelocalising) {
      EXPECT_EQ(learner.object()->views.size(), views) << "frame " << i;
    }
  }
  EXPECT_EQ(states, (std::vector<State>{State::kRelocalising, State::kRelocalising, State::kTracking, State::kTracking}));
  EXPECT_GT(learner.object()->views.size(), views);
}

TEST(Learner, SaysWhyThereIsNothingToLearn) {
  rgbd::Frame frame;
  frame.camera = {64, 48, 50, 50, 31.5, 23.5};
  frame.color = cv::Mat::zeros(48, 64, CV_8UC3);
  Learner learner(LearnerParams{}, "x");
  EXPECT_EQ(learner.Process(frame).note, "no depth");
  EXPECT_EQ(learner.object(), nullptr);
  frame.depth = cv::Mat::zeros(24, 32, CV_16UC1);
  EXPECT_THROW(learner.Process(frame), std::invalid_argument);
  LearnerParams params;
  params.new_view_confidence = 2.0;
  EXPECT_THROW(params.Check(), std::invalid_argument);
}

// The cracker box from two photographs at known poses, found in one between them; not in a picture without it.
TEST(Recogniser, FindsTheRealBoxAndOnlyWhereItIs) {
  VANTAGE_NEEDS_DATA("board");
  VANTAGE_NEEDS_DATA("osd");
  const rgbd::BopScene scene(testing::DataFolder() / "board");
  const auto truth = [&](int id) {
    for (const auto& object : scene.Truth(id)) {
      if (object.object_id == 3) return object.T_camera_object;
    }
    throw std::runtime_error("no truth");
  };
  LearnerParams params;
  params.recogniser.use_query_depth = false;
  Learner learner(params, "box");
  const rgbd::Frame first = scene.Load(132);
  Target target;
  target.pixel = first.camera.Project(truth(132).translation());
  ASSERT_TRUE(learner.Process(first, target).view_added);
  const geometry::Rigid T_mesh_object = truth(132).inverse() * learner.object()->views[0].T_camera_object;

  recognition::Recogniser recogniser(params.recogniser);
  recogniser.Set(learner.object());
  const rgbd::Frame query = scene.Load(46);
  const auto found = recogniser.Recognise(query, recogniser.Extract(query));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_GE(found[0].probability, 0.5);
  EXPECT_LT(model::MeanPointDistance(learner.object()->PointMatrix(), found[0].T_camera_object, truth(46) * T_mesh_object), 0.04);

  const rgbd::BopScene elsewhere(testing::DataFolder() / "osd");
  const rgbd::Frame without = elsewhere.Load(0);
  for (const auto& detection : recogniser.Recognise(without, recogniser.Extract(without))) EXPECT_LT(detection.probability, 0.5);

  recognition::RecogniserParams other = params.recogniser;
  other.features.contrast_threshold *= 2;
  EXPECT_THROW(recognition::Recogniser(other).Set(learner.object()), std::invalid_argument);
}

}  // namespace
}  // namespace vantage::learning
