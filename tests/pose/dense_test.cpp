// Texture holds what surface and interest points leave open.
#include "pose/dense.h"

#include <gtest/gtest.h>

#include <cmath>

namespace vantage::pose {
namespace {

constexpr double kDistance_m = 0.6;
constexpr double kHalf_m = 0.05;

// Brightness of a flat square at a point of it, metres.
double Pattern(double x, double y) { return 120.0 + 40.0 * std::sin(400.0 * x + 90.0 * y) + 35.0 * std::cos(350.0 * y - 60.0 * x); }

geometry::PinholeCamera TestCamera() {
  geometry::PinholeCamera camera;
  camera.width = 320;
  camera.height = 240;
  camera.fx = camera.fy = 525.0;
  camera.cx = 160.0;
  camera.cy = 120.0;
  return camera;
}

// The square (z = 0 of the object, facing -z) at a pose, seen by a camera whose picture has this contrast and brightness.
rgbd::Frame Picture(const geometry::Rigid& T_camera_object, double contrast, double brightness) {
  rgbd::Frame frame;
  frame.camera = TestCamera();
  frame.color = cv::Mat(frame.camera.height, frame.camera.width, CV_8UC3, cv::Scalar(30, 30, 30));
  frame.depth = cv::Mat::zeros(frame.color.size(), CV_16UC1);
  const geometry::Rigid T_object_camera = T_camera_object.inverse();
  for (int v = 0; v < frame.color.rows; ++v) {
    for (int u = 0; u < frame.color.cols; ++u) {
      const Eigen::Vector3d ray((u - frame.camera.cx) / frame.camera.fx, (v - frame.camera.cy) / frame.camera.fy, 1.0);
      const double z = -T_object_camera.translation().z() / (T_object_camera.linear() * ray).z();
      const Eigen::Vector3d at = T_object_camera * (z * ray);
      if (at.head<2>().cwiseAbs().maxCoeff() > kHalf_m) continue;
      frame.color.at<cv::Vec3b>(v, u) = cv::Vec3b::all(cv::saturate_cast<uchar>(contrast * Pattern(at.x(), at.y()) + brightness));
      frame.depth.at<std::uint16_t>(v, u) = cv::saturate_cast<std::uint16_t>(1000.0 * z);
    }
  }
  return frame;
}

Appearance LearnedFrom(const rgbd::Frame& frame, const geometry::Rigid& T_camera_object) {
  const SmoothImage image(frame, cv::Rect({0, 0}, frame.color.size()));
  Appearance appearance;
  appearance.textures.emplace_back();
  for (double y = -0.04; y <= 0.04; y += 0.004) {
    for (double x = -0.04; x <= 0.04; x += 0.004) {
      const Eigen::Vector3d point(x, y, 0.0), normal(0.0, 0.0, -1.0);
      appearance.surface.push_back({point, normal});
      const auto sample = image.At(*frame.camera.Project(T_camera_object * point));
      if (sample) appearance.textures.front().push_back({point, normal, sample->brightness});
    }
  }
  return appearance;
}

geometry::Rigid Pose(double turn_deg, double tilt_deg, double x_m, double y_m) {
  geometry::Rigid T = geometry::Rigid::Identity();
  T.translation() = Eigen::Vector3d(x_m, y_m, kDistance_m);
  T.linear() = (Eigen::AngleAxisd(turn_deg * M_PI / 180.0, Eigen::Vector3d::UnitZ()) *
                Eigen::AngleAxisd(tilt_deg * M_PI / 180.0, Eigen::Vector3d::UnitY()))
                   .toRotationMatrix();
  return T;
}

class Dense : public testing::Test {
 protected:
  const geometry::Rigid learned_at_ = Pose(0.0, 0.0, 0.0, 0.0);
  const Appearance appearance_ = LearnedFrom(Picture(learned_at_, 1.0, 0.0), learned_at_);
  const geometry::Rigid truth_ = Pose(4.0, 10.0, 0.006, -0.004);
  const geometry::Rigid start_ = Pose(3.2, 9.0, 0.0069, -0.0046);  // A pixel or so off.
};

TEST_F(Dense, TextureHoldsWhatAFlatSurfaceLeavesOpen) {
  const rgbd::Frame frame = Picture(truth_, 1.0, 0.0);
  const SmoothImage image(frame, cv::Rect({0, 0}, frame.color.size()));
  const auto by_surface = geometry::Difference(FitDensely(appearance_, frame, nullptr, start_, {}).T_camera_object, truth_);
  const DenseFit fit = FitDensely(appearance_, frame, &image, start_, {});
  const auto by_both = geometry::Difference(fit.T_camera_object, truth_);
  EXPECT_GT(by_surface.translation_m, 0.0008);  // It slides.
  EXPECT_LT(by_both.translation_m, 0.0002);
  EXPECT_LT(by_both.rotation_rad, 0.25 * M_PI / 180.0);
  EXPECT_GT(fit.texture_samples, 200);
}

TEST_F(Dense, AnotherExposureDoesNotMatter) {
  const rgbd::Frame frame = Picture(truth_, 0.7, 25.0);
  const SmoothImage image(frame, cv::Rect({0, 0}, frame.color.size()));
  const auto error = geometry::Difference(FitDensely(appearance_, frame, &image, start_, {}).T_camera_object, truth_);
  EXPECT_LT(error.translation_m, 0.0003);
  EXPECT_LT(error.rotation_rad, 0.2 * M_PI / 180.0);
}

TEST_F(Dense, AHandBeforeTheObjectDoesNotDragIt) {
  rgbd::Frame frame = Picture(truth_, 1.0, 0.0);
  const cv::Rect hand(0, 0, 145, 240);  // A third of the square.
  frame.color(hand).setTo(cv::Scalar(120, 150, 200));
  frame.depth(hand).setTo(450);
  const SmoothImage image(frame, cv::Rect({0, 0}, frame.color.size()));
  const auto error = geometry::Difference(FitDensely(appearance_, frame, &image, start_, {}).T_camera_object, truth_);
  EXPECT_LT(error.translation_m, 0.0005);
  EXPECT_LT(error.rotation_rad, 0.5 * M_PI / 180.0);
}

TEST_F(Dense, HoldsAPoseThatMatchesPlaceWrongly) {
  const rgbd::Frame frame = Picture(truth_, 1.0, 0.0);
  const SmoothImage image(frame, cv::Rect({0, 0}, frame.color.size()));
  std::vector<Match2d3d> matches;  // All two pixels to the right, as those that stay with an outline.
  std::vector<int> index;
  for (const SurfacePoint& sample : appearance_.surface) {
    if (matches.size() == 12) break;
    index.push_back(static_cast<int>(matches.size()));
    matches.push_back({*frame.camera.Project(truth_ * sample.point) + Eigen::Vector2d(2.0, 0.0), sample.point, 0.0});
  }
  const auto placed = [&](const Appearance& appearance, const SmoothImage* smooth) {
    return geometry::Difference(
        RefinePoseDensely(matches, index, appearance, frame, smooth, std::nullopt, start_, 1.5, DenseParams{}), truth_);
  };
  EXPECT_LT(placed(appearance_, &image).translation_m, 0.3 * placed({appearance_.surface, {}}, nullptr).translation_m);
}

// How much a pose looks like the object, and how much of its surface is there, as they are (no step is taken).
TEST_F(Dense, LikenessAndAgreementTellWhetherTheObjectIsThere) {
  const rgbd::Frame frame = Picture(truth_, 0.8, 10.0);
  const SmoothImage image(frame, cv::Rect({0, 0}, frame.color.size()));
  const auto at = [&](const geometry::Rigid& T) { return FitDensely(appearance_, frame, &image, T, {}, 0); };
  const DenseFit right = at(truth_);
  ASSERT_TRUE(right.likeness && right.agreement);
  EXPECT_GT(*right.likeness, 0.98);
  EXPECT_GT(*right.agreement, 0.98);
  geometry::Rigid beside = truth_;  // Seven pixels along itself: the surface is there, its print is not.
  beside.translate(Eigen::Vector3d(0.008, 0.0, 0.0));
  EXPECT_LT(at(beside).likeness.value(), 0.5);
  EXPECT_GT(at(beside).agreement.value(), 0.95);
  geometry::Rigid nearer = truth_;
  nearer.pretranslate(Eigen::Vector3d(0.0, 0.0, -0.03));
  EXPECT_LT(at(nearer).agreement.value(), 0.05);
}

TEST_F(Dense, ASurfaceAloneHoldsThePoseAsFarAsItCan) {
  const rgbd::Frame frame = Picture(truth_, 1.0, 0.0);
  const geometry::Rigid start = Pose(4.0, 14.0, 0.006, -0.004);  // Four degrees of tilt, and no interest point at all.
  const auto placed = RefinePoseDensely({}, {}, {appearance_.surface, {}}, frame, nullptr, std::nullopt, start, 1.5, {});
  EXPECT_LT(geometry::Difference(placed, truth_).rotation_rad, 0.1 * M_PI / 180.0);
  EXPECT_LT(geometry::Difference(placed, truth_).translation_m, 0.0005);  // It did not slide either.
}

TEST_F(Dense, NothingToSeeLeavesThePoseAsItIs) {
  rgbd::Frame blank = Picture(truth_, 0.0, 90.0);
  blank.depth = cv::Mat();
  const SmoothImage image(blank, cv::Rect(200, 100, 400, 400));  // Mostly outside.
  EXPECT_FALSE(image.At({10.0, 10.0}));
  const DenseFit fit = FitDensely(appearance_, blank, &image, start_, {});
  EXPECT_EQ(fit.samples, 0);
  EXPECT_FALSE(fit.likeness);
  EXPECT_FALSE(fit.agreement);
  EXPECT_TRUE(fit.T_camera_object.isApprox(start_));
  EXPECT_FALSE(SmoothImage(blank, cv::Rect(1000, 1000, 5, 5)).At({100.0, 100.0}));
}

}  // namespace
}  // namespace vantage::pose
