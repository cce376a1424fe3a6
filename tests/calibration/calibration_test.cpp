#include <gtest/gtest.h>

#include <cmath>

#include "calibration/board_pose.h"
#include "calibration/hand_eye.h"
#include "calibration/intrinsics.h"
#include "calibration/render_board.h"
#include "rgbd/bop.h"
#include "support/data.h"

namespace vantage::calibration {
namespace {

constexpr double kDegrees = 180.0 / M_PI;

rgbd::CameraCalibration Lens() { return {{640, 480, 530.0, 528.0, 325.0, 236.0}, {-0.18, 0.06, 0.001, -0.0015, 0.0}}; }

Board Checkerboard() {
  Board board;
  board.columns = 9;
  board.rows = 6;
  board.square_m = 0.025;
  return board;
}
Board Tags() { return TagGrid("36h11", 5, 4, 0.04, 0.012, 10); }

Eigen::Vector3d Middle(const Board& board) {
  return board.kind == Board::Kind::kCheckerboard ? Eigen::Vector3d(0.1, 0.0625, 0) : Eigen::Vector3d(0.124, 0.098, 0);
}

std::vector<BoardView> Views(const Board& board, int count) {
  const cv::Mat paper = testing::PrintBoard(board);
  std::vector<BoardView> views;
  for (int i = 0; i < count; ++i) {
    cv::Mat gray;
    cv::cvtColor(testing::PhotographBoard(paper, Lens(), testing::BoardPoseOf(i, Middle(board)), i), gray, cv::COLOR_BGR2GRAY);
    views.push_back(FindBoard(gray, board));
  }
  return views;
}

TEST(Board, IsFoundToAFractionOfAPixel) {
  for (const Board& board : {Checkerboard(), Tags()}) {
    const auto views = Views(board, 6);
    int found = 0;
    for (int i = 0; i < 6; ++i) {
      const auto T_camera_board = testing::BoardPoseOf(i, Middle(board));
      double sum = 0.0;
      const BoardView& view = views[static_cast<std::size_t>(i)];
      for (std::size_t p = 0; p < view.points_m.size(); ++p) {
        const Eigen::Vector2d error = ProjectDistorted(Lens(), T_camera_board * view.points_m[p]) - view.pixels[p];
        EXPECT_LT(error.norm(), 1.0);
        sum += error.squaredNorm();
      }
      if (view.empty()) continue;
      ++found;
      EXPECT_LT(std::sqrt(sum / static_cast<double>(view.points_m.size())), board.tags.empty() ? 0.15 : 0.3) << "view " << i;
    }
    EXPECT_GE(found, 4);
  }
}

TEST(Board, OneThatIsNotThereIsNotFound) {
  cv::Mat gray(480, 640, CV_8UC1, cv::Scalar(128));
  EXPECT_TRUE(FindBoard(gray, Checkerboard()).empty());
  EXPECT_TRUE(FindBoard(gray, Tags()).empty());
  Board square = Checkerboard();
  square.rows = 9;
  EXPECT_THROW(FindBoard(gray, square), std::invalid_argument);
  Board unknown = Tags();
  unknown.dictionary = "99h1";
  EXPECT_THROW(FindBoard(gray, unknown), std::invalid_argument);
}

TEST(BoardPose, IsRightAndLeavesOutATagThatMoved) {
  for (const Board& board : {Checkerboard(), Tags()}) {
    auto views = Views(board, 4);
    for (int i = 0; i < 4; ++i) {
      BoardView& view = views[static_cast<std::size_t>(i)];
      if (view.empty()) continue;
      const bool moved = board.kind == Board::Kind::kTags;
      if (moved) {
        for (int corner = 0; corner < 4; ++corner) view.pixels[static_cast<std::size_t>(corner)] += Eigen::Vector2d(25.0, -10.0);
      }
      const auto pose = EstimateBoardPose(view, Lens());
      ASSERT_TRUE(pose);
      const auto difference = geometry::Difference(pose->T_camera_board, testing::BoardPoseOf(i, Middle(board)));
      EXPECT_LT(difference.translation_m, 0.001);
      EXPECT_LT(difference.rotation_rad * kDegrees, 0.15);
      EXPECT_EQ(pose->dropped, moved ? 4 : 0);
      EXPECT_LT(pose->rms_px, 0.35);
    }
  }
  EXPECT_FALSE(EstimateBoardPose({}, Lens()));
}

TEST(Intrinsics, AreFoundAgainFromPictures) {
  for (const Board& board : {Checkerboard(), Tags()}) {
    const auto views = Views(board, 20);
    const IntrinsicsResult result = CalibrateIntrinsics(views, {640, 480});
    const auto& camera = result.calibration.camera;
    EXPECT_NEAR(camera.fx, 530.0, 2.0);
    EXPECT_NEAR(camera.fy, 528.0, 2.0);
    EXPECT_NEAR(camera.cx, 325.0, 2.0);
    EXPECT_NEAR(camera.cy, 236.0, 2.0);
    EXPECT_LT(std::abs(camera.fx - 530.0), 5.0 * result.focal_sigma_px + 0.3) << "its own error bar is honest";
    EXPECT_LT(result.rms_px, 0.35);
    EXPECT_GT(result.used.size(), 12u);
    // What counts is where points are seen.
    for (double x = -0.4; x <= 0.4; x += 0.1) {
      for (double y = -0.3; y <= 0.3; y += 0.1) {
        const Eigen::Vector3d point(x, y, 1.0);
        EXPECT_LT((ProjectDistorted(result.calibration, point) - ProjectDistorted(Lens(), point)).norm(), 1.0) << x << ' ' << y;
      }
    }
    EXPECT_EQ(DrawCoverage(views, result).size(), cv::Size(640, 480));
  }
}

TEST(Intrinsics, SayWhatMakesThemDoubtful) {
  const Board board = Checkerboard();
  const cv::Mat paper = testing::PrintBoard(board);
  std::vector<BoardView> frontal;
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector3d eye = Middle(board) + Eigen::Vector3d(0.01 * i, 0, -0.5);
    const auto T = geometry::LookAt(eye, eye + Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0, -1, 0)).inverse();
    cv::Mat gray;
    cv::cvtColor(testing::PhotographBoard(paper, Lens(), T, i), gray, cv::COLOR_BGR2GRAY);
    frontal.push_back(FindBoard(gray, board));
    ASSERT_FALSE(frontal.back().empty());
  }
  IntrinsicsParams params;
  params.distortion_terms = 0;
  const auto result = CalibrateIntrinsics(frontal, {640, 480}, params);
  std::string all;
  for (const auto& warning : result.warnings) all += warning + "\n";
  for (const char* word : {"only 4 views", "% of the image only", "never tilted"})
    EXPECT_NE(all.find(word), std::string::npos) << all;
  EXPECT_THROW(CalibrateIntrinsics({frontal[0], frontal[1], {}}, {640, 480}), std::runtime_error);
}

TEST(Intrinsics, AViewThatDoesNotFitIsLeftOut) {
  auto views = Views(Tags(), 16);
  for (std::size_t i = 0; i < views[5].pixels.size(); ++i) views[5].pixels[i].x() += (i % 3 == 0) ? 9.0 : -4.0;
  const auto result = CalibrateIntrinsics(views, {640, 480});
  EXPECT_EQ(std::count(result.used.begin(), result.used.end(), 5), 0);
  EXPECT_NEAR(result.calibration.camera.fx, 530.0, 3.0);
}

// Views of a board that stands at the origin of the world, from a mount with small errors of its own.
std::vector<HandEyeView> Mounted(const geometry::Rigid& T_mount_camera, int count, bool one_axis) {
  const Board board = Tags();
  const cv::Mat paper = testing::PrintBoard(board);
  std::vector<HandEyeView> views;
  for (int i = 0; i < count; ++i) {
    geometry::Rigid T_camera_board = testing::BoardPoseOf(i, Middle(board));
    if (one_axis) {
      T_camera_board = testing::BoardPoseOf(0, Middle(board)) * Eigen::Translation3d(Middle(board)) *
                       Eigen::AngleAxisd(0.1 * i, Eigen::Vector3d::UnitZ()) * Eigen::Translation3d(-Middle(board));
    }
    cv::Mat gray;
    cv::cvtColor(testing::PhotographBoard(paper, Lens(), T_camera_board, i), gray, cv::COLOR_BGR2GRAY);
    HandEyeView view;
    view.T_world_mount = (T_mount_camera * T_camera_board).inverse();
    view.board = FindBoard(gray, board);
    views.push_back(view);
  }
  return views;
}

TEST(HandEye, IsFoundAgain) {
  geometry::Rigid T_mount_camera = geometry::Rigid::Identity();
  T_mount_camera.linear() =
      (Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()) * Eigen::AngleAxisd(-1.2, Eigen::Vector3d::UnitX())).toRotationMatrix();
  T_mount_camera.translation() = Eigen::Vector3d(0.03, -0.05, 0.08);
  auto views = Mounted(T_mount_camera, 12, false);
  const auto exact = CalibrateHandEye(views, Lens());
  EXPECT_LT(geometry::Difference(exact.T_mount_camera, T_mount_camera).translation_m, 0.001);
  EXPECT_LT(geometry::Difference(exact.T_mount_camera, T_mount_camera).rotation_rad * kDegrees, 0.1);
  EXPECT_LT(geometry::Difference(exact.T_world_board, geometry::Rigid::Identity()).translation_m, 0.001);
  EXPECT_LT(exact.rms_px, 0.3);
  EXPECT_TRUE(exact.warnings.empty()) << exact.warnings.front();
  // The mount errs by 2 mm: the answer suffers less than that, and the disagreement is told.
  for (std::size_t i = 0; i < views.size(); ++i) {
    views[i].T_world_mount.translation() += 0.002 * Eigen::Vector3d(std::sin(3.0 * i), std::cos(5.0 * i), std::sin(7.0 * i));
  }
  const auto rough = CalibrateHandEye(views, Lens());
  EXPECT_LT(geometry::Difference(rough.T_mount_camera, T_mount_camera).translation_m, 0.004);
  EXPECT_GT(rough.position_mm, 1.0);
  EXPECT_GT(rough.rms_px, exact.rms_px);
}

TEST(HandEye, SaysWhenTheMountTurnedTooLittle) {
  const auto views = Mounted(geometry::Rigid::Identity(), 5, true);
  try {
    CalibrateHandEye(views, Lens());
    FAIL() << "accepted";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("one axis"), std::string::npos) << error.what();
  }
}

TEST(Undistorter, MakesStraightWhatTheLensBent) {
  const Board board = Checkerboard();
  const auto T = testing::BoardPoseOf(0, Middle(board));
  rgbd::Frame frame;
  frame.color = testing::PhotographBoard(testing::PrintBoard(board), Lens(), T, 0);
  frame.depth = cv::Mat(480, 640, CV_16UC1, cv::Scalar(700));
  frame.camera = Lens().camera;
  rgbd::Undistorter(Lens()).Undistort(frame);
  cv::Mat gray;
  cv::cvtColor(frame.color, gray, cv::COLOR_BGR2GRAY);
  const BoardView view = FindBoard(gray, board);
  ASSERT_FALSE(view.empty());
  for (std::size_t i = 0; i < view.points_m.size(); ++i) {
    EXPECT_LT((*frame.camera.Project(T * view.points_m[i]) - view.pixels[i]).norm(), 0.5);
  }
  EXPECT_EQ(frame.depth.at<std::uint16_t>(240, 320), 700);
  frame.color = cv::Mat(240, 320, CV_8UC3);
  EXPECT_THROW(rgbd::Undistorter(Lens()).Undistort(frame), std::invalid_argument);
}

}  // namespace
}  // namespace vantage::calibration
