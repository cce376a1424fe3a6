#include "learning/tracker.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace vantage::learning {
namespace {

// The object's outline in the image: the convex hull of its projected points.
std::vector<cv::Point> Outline(const model::ObjectModel& object, const geometry::PinholeCamera& camera,
                               const geometry::Rigid& T_camera_object) {
  std::vector<cv::Point> pixels, hull;
  for (const model::ModelPoint& point : object.points) {
    const auto pixel = camera.Project(T_camera_object * point.position);
    // Far outside, whole pixels overflow.
    if (pixel && pixel->cwiseAbs().maxCoeff() < 1e5) pixels.emplace_back(std::lround(pixel->x()), std::lround(pixel->y()));
  }
  if (!pixels.empty()) cv::convexHull(pixels, hull);
  return hull;
}

// The hull and everything at most `margin` pixels around it, 255 in the image.
cv::Mat Widened(const std::vector<cv::Point>& hull, int margin, const geometry::PinholeCamera& camera) {
  cv::Mat mask = cv::Mat::zeros(camera.height, camera.width, CV_8UC1);
  cv::fillConvexPoly(mask, hull, 255);
  const int thickness = std::clamp(2 * margin, 1, 32767);
  cv::polylines(mask, hull, true, 255, thickness);
  return mask;
}

// With at most `count` samples of texture, evenly chosen.
pose::Appearance WithTextureOf(const pose::Appearance& appearance, int count) {
  std::size_t samples = 0;
  for (const auto& texture : appearance.textures) samples += texture.size();
  const double step = std::max(1.0, static_cast<double>(samples) / count);
  pose::Appearance thinned;
  thinned.surface = appearance.surface;
  for (const auto& texture : appearance.textures) {
    thinned.textures.emplace_back();
    for (double at = 0.0; at < static_cast<double>(texture.size()); at += step) {
      thinned.textures.back().push_back(texture[static_cast<std::size_t>(at)]);
    }
  }
  return thinned;
}

}  // namespace

// All that a frame says about the pose of an object that was found in it.
struct Tracker::Evidence {
  std::vector<pose::Match2d3d> matches;
  std::vector<int> all;  // Their indices.
  pose::Appearance appearance;
  std::optional<pose::SmoothImage> image;  // Where the object is; none where texture is not wanted.

  const pose::SmoothImage* smooth() const { return image ? &*image : nullptr; }
};

Tracker::Evidence Tracker::EvidenceIn(const rgbd::Frame& frame, const features::Features& features,
                                      const model::ObjectModel& object, const recognition::GuidedPose& guided) const {
  constexpr int kMargin_px = 20;  // Around the outline.
  Evidence evidence;
  for (const recognition::GuidedMatch& match : guided.matches) {
    const cv::Point2f& at = features.keypoints[match.keypoint].pt;
    const Eigen::Vector2d pixel(at.x, at.y);
    evidence.all.push_back(static_cast<int>(evidence.matches.size()));
    evidence.matches.push_back({pixel, object.points[match.point].position});  // Depth is the surface's to say.
  }
  evidence.appearance = appearances_->Near(object, guided.T_camera_object);
  if (frame.depth.empty()) evidence.appearance.surface.clear();
  const std::vector<cv::Point> hull = Outline(object, frame.camera, guided.T_camera_object);
  if (params_.texture_samples > 0 && !hull.empty()) {
    const cv::Rect box = cv::boundingRect(hull);
    evidence.image.emplace(
        frame, cv::Rect(box.x - kMargin_px, box.y - kMargin_px, box.width + 2 * kMargin_px, box.height + 2 * kMargin_px));
  }
  return evidence;
}

features::Features Tracker::ExtractAround(const model::ObjectModel& object, const rgbd::Frame& frame,
                                          const Expectation& expectation) const {
  const std::vector<cv::Point> hull = Outline(object, frame.camera, expectation.T_camera_object);
  if (hull.empty()) return {};
  const cv::Mat mask = Widened(hull, static_cast<int>(std::lround(expectation.margin_px)), frame.camera);
  if (cv::countNonZero(mask) == 0) return {};
  return features::Extract(rgbd::Gray(frame), mask, params_.recogniser.features);
}

bool Tracker::Agree(const geometry::Rigid& T_camera_object_a, const geometry::Rigid& T_camera_object_b) const {
  const geometry::PoseDifference difference = geometry::Difference(T_camera_object_a, T_camera_object_b);
  return difference.translation_m <= params_.max_mount_translation_m &&
         difference.rotation_rad <= params_.max_mount_rotation_deg * M_PI / 180.0;
}

geometry::Rigid Tracker::Refined(const rgbd::Frame& frame, const Evidence& evidence, const geometry::Rigid& T_camera_object,
                                 const std::optional<geometry::Rigid>& mount_pose) const {
  std::optional<pose::PosePrior> prior;
  if (mount_pose && Agree(T_camera_object, *mount_pose)) {
    prior = pose::PosePrior{*mount_pose, params_.mount_sigma_m, params_.mount_sigma_deg * M_PI / 180.0};
  }
  return pose::RefinePoseDensely(evidence.matches, evidence.all, evidence.appearance, frame, evidence.smooth(), prior,
                                 T_camera_object, 0.5 * params_.recogniser.ransac.inlier_px, params_.refinement.dense);
}

void Tracker::Weigh(const rgbd::Frame& frame, const Evidence& evidence, Track* track) const {
  constexpr double kPixelSigma = 1.0;
  constexpr int kIndependentTexture = 200;  // Brightness errs together among neighbours: more samples do not hold a pose better.
  const pose::Appearance independent = WithTextureOf(evidence.appearance, kIndependentTexture);
  const pose::DenseFit dense =
      pose::FitDensely(independent, frame, evidence.smooth(), track->T_camera_object, params_.refinement.dense, 0);
  const pose::Appearance all_texture{{}, evidence.appearance.textures};  // Of few samples too few are seen from aside to compare.
  track->likeness =
      pose::FitDensely(all_texture, frame, evidence.smooth(), track->T_camera_object, params_.refinement.dense, 0).likeness;
  track->surface_agreement = dense.agreement;
  track->spread =
      pose::SpreadOfPose(evidence.matches, evidence.all, frame.camera, track->T_camera_object, kPixelSigma, dense.information);
}

Track Tracker::At(const model::ObjectModel& object, const rgbd::Frame& frame, const features::Features& features,
                  const geometry::Rigid& T_camera_object, bool refine, const std::optional<geometry::Rigid>& mount_pose) const {
  const recognition::RecogniserParams& recogniser = params_.recogniser;
  recognition::GuidedParams guided_params;
  guided_params.radius_px = recogniser.guided_radius_px;
  guided_params.max_distance = recogniser.guided_max_distance;
  guided_params.inlier_px = recogniser.ransac.inlier_px;
  rgbd::Frame query = frame;
  if (!recogniser.use_query_depth) query.depth = cv::Mat();
  const model::KeypointGrid grid(features.keypoints, frame.camera.width, frame.camera.height);
  const auto guided = recognition::MatchGuided(object, T_camera_object, query, features, grid, guided_params);
  Track track;
  track.matches = guided.matches;
  const Evidence evidence = EvidenceIn(query, features, object, guided);
  track.T_camera_object = refine ? Refined(query, evidence, guided.T_camera_object, mount_pose) : T_camera_object;
  track.confidence = model::ObjectConfidence(object, track.T_camera_object, query, grid, recogniser.confidence);
  track.probability = object.measures.observed.Probability(track.confidence.value);
  Weigh(query, evidence, &track);
  track.features = features;
  return track;
}

std::optional<Track> Tracker::AgainstView(const model::ObjectModel& object, int view, const rgbd::Frame& frame,
                                          const features::Features& features,
                                          const std::optional<geometry::Rigid>& mount_pose) const {
  const recognition::RecogniserParams& recogniser = params_.recogniser;
  const model::View& reference = object.views[view];
  std::vector<pose::Match2d3d> matches;
  for (const features::Match& match :
       features::MatchRatio(features.descriptors, reference.features.descriptors, recogniser.matching.max_ratio)) {
    const cv::Point2f& pixel = features.keypoints[match.query].pt;
    matches.push_back({{pixel.x, pixel.y}, object.points[reference.points[match.train]].position});
  }
  const auto estimate =
      pose::EstimatePose(matches, frame.camera, recogniser.use_query_depth ? &frame : nullptr, recogniser.ransac, recogniser.seed);
  if (!estimate || static_cast<int>(estimate->inliers.size()) < recogniser.min_inliers) return std::nullopt;
  return At(object, frame, features, estimate->T_camera_object, true, mount_pose);
}

}  // namespace vantage::learning
