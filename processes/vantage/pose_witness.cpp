#include "vantage/pose_witness.h"

#include <opencv2/imgproc.hpp>
#include <optional>
#include <sstream>

#include "learning/keyframe.h"
#include "pose/ransac.h"
#include "vantage/learner_trial.h"

namespace vantage::cli {
namespace {

constexpr double kDegrees = 180.0 / M_PI;

// 255 where the object is not.
cv::Mat Background(const WitnessedFrame& seen, const Eigen::Matrix3Xd& points_in_object) {
  constexpr int kMargin_px = 10;
  const geometry::PinholeCamera& camera = seen.frame.camera;
  std::vector<cv::Point> pixels, hull;
  for (Eigen::Index i = 0; i < points_in_object.cols(); ++i) {
    const auto pixel = camera.Project(seen.T_camera_object * Eigen::Vector3d(points_in_object.col(i)));
    if (pixel && pixel->cwiseAbs().maxCoeff() < 1e5) pixels.emplace_back(std::lround(pixel->x()), std::lround(pixel->y()));
  }
  cv::Mat mask(camera.height, camera.width, CV_8UC1, cv::Scalar(255));
  if (pixels.empty()) return mask;
  cv::convexHull(pixels, hull);
  cv::fillConvexPoly(mask, hull, 0);
  cv::polylines(mask, hull, true, 0, 2 * kMargin_px);
  return mask;
}

// What a frame shows outside the mask's zeros, camera coordinates.
pose::Appearance AppearanceOf(const rgbd::Frame& frame, const cv::Mat& mask) {
  constexpr int kSurfaceSamples = 4000, kTextureSamples = 2000;
  model::View view;
  view.keyframe = frame;
  view.mask = mask;
  return {learning::SurfaceOfView(view, kSurfaceSamples), {learning::TextureOfView(view, kTextureSamples)}};
}

// T_to_from by matched interest points and the depth at those of `from`.
std::optional<geometry::Rigid> MotionOfPoints(const rgbd::Frame& from, const features::Features& from_features,
                                              const rgbd::Frame& to, const features::Features& to_features,
                                              const recognition::RecogniserParams& params) {
  constexpr std::size_t kFew = 15;
  std::vector<pose::Match2d3d> matches;
  for (const features::Match& match :
       features::MatchRatio(to_features.descriptors, from_features.descriptors, params.matching.max_ratio)) {
    const cv::Point2f& there = from_features.keypoints[match.train].pt;
    const cv::Point2f& here = to_features.keypoints[match.query].pt;
    if (const auto point = rgbd::PointAt(from, {there.x, there.y})) matches.push_back({{here.x, here.y}, *point});
  }
  const auto estimate = pose::EstimatePose(matches, to.camera, nullptr, params.ransac, params.seed);
  if (!estimate || estimate->inliers.size() < kFew) return std::nullopt;
  return estimate->T_camera_object;
}

// ...then by all that both show.
geometry::Rigid MotionOfAll(const pose::Appearance& from, const rgbd::Frame& to, const geometry::Rigid& T_to_from,
                            const pose::DenseParams& params) {
  const pose::SmoothImage image(to, cv::Rect({0, 0}, to.color.size()));
  return pose::FitDensely(from, to, &image, T_to_from, params).T_camera_object;
}

PoseError Error(const geometry::Rigid& T_a, const geometry::Rigid& T_b) {
  const geometry::PoseDifference difference = geometry::Difference(T_a, T_b);
  return {1e3 * difference.translation_m, difference.rotation_rad * kDegrees};
}

}  // namespace

Json WitnessFigures(const std::vector<WitnessedFrame>& frames, const Eigen::Matrix3Xd& points_in_object,
                    const learning::LearnerParams& params, int gap) {
  const recognition::RecogniserParams& recogniser = params.recogniser;
  std::vector<features::Features> features;
  std::vector<pose::Appearance> appearances;
  for (const WitnessedFrame& seen : frames) {
    const cv::Mat mask = Background(seen, points_in_object);
    features.push_back(features::Extract(rgbd::Gray(seen.frame), mask, recogniser.features));
    appearances.push_back(AppearanceOf(seen.frame, mask));
  }
  std::vector<PoseError> recorded, tracked, each_other, own;
  for (std::size_t to = gap; to < frames.size(); ++to) {
    const std::size_t from = to - gap;
    const WitnessedFrame &a = frames[from], &b = frames[to];
    const auto start = MotionOfPoints(a.frame, features[from], b.frame, features[to], recogniser);
    if (!start) continue;
    const geometry::Rigid there = MotionOfAll(appearances[from], b.frame, *start, params.refinement.dense);
    const geometry::Rigid back = MotionOfAll(appearances[to], a.frame, start->inverse(), params.refinement.dense);
    const geometry::Rigid by_recorded = b.T_camera_recorded * a.T_camera_recorded.inverse();
    const geometry::Rigid by_tracked = b.T_camera_object * a.T_camera_object.inverse();
    recorded.push_back(Error(by_recorded, there));
    tracked.push_back(Error(by_tracked, there));
    each_other.push_back(Error(by_recorded, by_tracked));
    own.push_back(Error(back.inverse(), there));
  }
  return {{"gap", gap},
          {"pairs", own.size()},
          {"own", ErrorFigures(own)},
          {"recorded", ErrorFigures(recorded)},
          {"tracked", ErrorFigures(tracked)},
          {"each_other", ErrorFigures(each_other)}};
}

std::string WitnessSummary(const Json& figures) {
  std::ostringstream text;
  const auto both = [](const Json& error) {
    std::ostringstream one;
    one << error["mm"]["median"] << " mm " << error["deg"]["median"] << " deg (p95 " << error["deg"]["p95"] << ")";
    return one.str();
  };
  text << "motion over " << figures["gap"] << " frames (" << figures["pairs"]
       << " pairs): the pictures against themselves, there and back, " << both(figures["own"]) << "; against the recorded poses "
       << both(figures["recorded"]) << ", the tracked " << both(figures["tracked"]) << "; these two " << both(figures["each_other"])
       << '\n';
  return text.str();
}

}  // namespace vantage::cli
