#include "learning/learner.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "learning/keyframe.h"
#include "recognition/guided.h"

namespace vantage::learning {
namespace {

constexpr double kSeen = 0.5;  // p(o|c) from which a pose counts as the object's.

// A pose of the object in a frame, with what speaks for it.
struct Track {
  geometry::Rigid T_camera_object = geometry::Rigid::Identity();
  features::Features features;
  std::vector<recognition::GuidedMatch> matches;
  model::Confidence confidence;
  double probability = 0.0;
};

}  // namespace

std::string ToString(State state) {
  switch (state) {
    case State::kSearching:
      return "searching";
    case State::kTracking:
      return "tracking";
    case State::kLost:
      return "lost";
    case State::kRelocalising:
      return "relocalising";
  }
  return "";
}

void LearnerParams::Check() const {
  plane.Check();
  clusters.Check();
  recogniser.Check();
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(std::string("learner: ") + what);
  };
  require(new_view_confidence > 0.0 && new_view_confidence < 1.0, "new_view_confidence must be in (0, 1)");
  require(min_track_probability > 0.0 && min_track_probability < 1.0, "min_track_probability must be in (0, 1)");
  require(min_view_points >= 4, "min_view_points must be >= 4");
  require(min_view_angle_deg >= 0.0, "min_view_angle_deg must be >= 0");
  require(surface_samples >= 0, "surface_samples must be >= 0");
  require(surface_views >= 1, "surface_views must be >= 1");
  require(roi_margin >= 0.0, "roi_margin must be >= 0");
  require(max_mount_translation_m > 0.0, "max_mount_translation_m must be > 0");
  require(max_mount_rotation_deg > 0.0, "max_mount_rotation_deg must be > 0");
  require(mount_sigma_m > 0.0, "mount_sigma_m must be > 0");
  require(mount_sigma_deg > 0.0, "mount_sigma_deg must be > 0");
  require(agreement_prior >= 0.5 && agreement_prior < 1.0, "agreement_prior must be in [1/2, 1)");
}

struct Learner::Impl {
  LearnerParams params;
  std::string name;
  std::shared_ptr<const model::ObjectModel> object;
  recognition::Recogniser recogniser;
  State state = State::kSearching;
  int reference_view = -1;
  std::optional<geometry::Rigid> last_pose;  // T_camera_object of the last frame, where it was tracked.
  std::optional<geometry::Rigid> T_world_object;
  std::optional<segmentation::Plane> plane;
  std::vector<segmentation::Cluster> clusters;

  Impl(const LearnerParams& p, const std::string& object_name) : params(p), name(object_name), recogniser(p.recogniser) {}

  void Adopt(model::ObjectModel changed) {
    object = std::make_shared<const model::ObjectModel>(std::move(changed));
    recogniser.Set(object);
  }

  bool Segment(const rgbd::Frame& frame) {
    plane = segmentation::FitPlane(frame, params.plane);
    clusters.clear();
    if (plane) clusters = segmentation::FindClusters(frame, *plane, params.clusters);
    return plane.has_value();
  }

  // --- The first view ---

  LearnerResult Start(const rgbd::Frame& frame, const Target& target, const std::optional<geometry::Rigid>& known_pose) {
    LearnerResult result;
    if (!Segment(frame)) {
      result.note = frame.depth.empty() ? "no depth" : "no table plane";
      return result;
    }
    const int index =
        target.pixel ? segmentation::ClusterAt(clusters, *target.pixel) : segmentation::ClusterNearestCentre(clusters);
    if (index < 0) {
      result.note = clusters.empty() ? "nothing stands on the table" : "no cluster at the target";
      return result;
    }
    const cv::Mat& mask = clusters[index].mask;
    const geometry::Rigid T_camera_object = known_pose.value_or(FirstPose(frame, *plane, clusters[index]));
    const features::Features features = features::Extract(rgbd::Gray(frame), mask, params.recogniser.features);
    model::ObjectModel empty;
    empty.name = name;
    empty.feature_fingerprint = params.recogniser.features.Fingerprint();
    auto first = WithView(empty, frame, mask, features, T_camera_object, {}, params.min_view_points);
    if (!first) {
      result.note = "too few interest points with depth on the object";
      return result;
    }
    Adopt(std::move(*first));
    if (frame.T_world_camera) T_world_object = *frame.T_world_camera * T_camera_object;
    last_pose = T_camera_object;
    reference_view = 0;
    state = result.state = State::kTracking;
    result.T_camera_object = T_camera_object;
    result.confidence.value = 1.0;
    result.probability = 1.0;
    result.reference_view = 0;
    result.view_added = true;
    return result;
  }

  // --- Tracking ---

  // Where the mount says the object is, if it says.
  std::optional<geometry::Rigid> MountPose(const rgbd::Frame& frame) const {
    if (!frame.T_world_camera || !T_world_object) return std::nullopt;
    return frame.T_world_camera->inverse() * *T_world_object;
  }

  // The part of the image the object can be in: around where it was seen last or where the mount says it is. Empty: anywhere.
  cv::Mat RegionOfInterest(const rgbd::Frame& frame, const std::optional<geometry::Rigid>& expected) const {
    if (!expected) return {};
    std::vector<cv::Point2f> pixels;
    for (const model::ModelPoint& point : object->points) {
      if (const auto pixel = frame.camera.Project(*expected * point.position)) pixels.emplace_back(pixel->x(), pixel->y());
    }
    if (pixels.empty()) return {};
    const cv::Rect box = cv::boundingRect(pixels);
    const int margin = static_cast<int>(params.roi_margin * std::max(box.width, box.height)) + 20;
    const cv::Rect area = cv::Rect(box.x - margin, box.y - margin, box.width + 2 * margin, box.height + 2 * margin) &
                          cv::Rect(0, 0, frame.camera.width, frame.camera.height);
    if (area.empty()) return {};
    cv::Mat mask = cv::Mat::zeros(frame.camera.height, frame.camera.width, CV_8UC1);
    mask(area).setTo(255);
    return mask;
  }

  std::vector<pose::SurfacePoint> SurfaceNear(const geometry::Rigid& T_camera_object) const {
    std::vector<pose::SurfacePoint> surface;
    const std::vector<int> nearest = model::NearestViews(*object, T_camera_object, params.surface_views);
    for (const int view : nearest) {
      const auto part = SurfaceOfView(object->views[view], params.surface_samples / static_cast<int>(nearest.size()));
      surface.insert(surface.end(), part.begin(), part.end());
    }
    return surface;
  }

  // The guided pose, drawn to the depth image by the surfaces of the nearest views and, where it agrees, to the mount's pose.
  geometry::Rigid Refined(const rgbd::Frame& frame, const features::Features& features,
                          const recognition::GuidedPose& guided) const {
    std::vector<pose::Match2d3d> matches;
    std::vector<int> all;
    for (const recognition::GuidedMatch& match : guided.matches) {
      const cv::Point2f& pixel = features.keypoints[match.keypoint].pt;
      all.push_back(static_cast<int>(matches.size()));
      matches.push_back({{pixel.x, pixel.y}, object->points[match.point].position, 0.0});
    }
    std::vector<pose::SurfacePoint> surface;
    if (!frame.depth.empty() && params.surface_samples > 0) surface = SurfaceNear(guided.T_camera_object);
    std::optional<pose::PosePrior> prior;
    const auto expected = MountPose(frame);
    if (expected && AgreesWithMount(guided.T_camera_object, *expected)) {
      prior = pose::PosePrior{*expected, params.mount_sigma_m, params.mount_sigma_deg * M_PI / 180.0};
    }
    if (surface.empty() && !prior) return guided.T_camera_object;
    return pose::RefinePoseOnSurface(matches, all, surface, frame, prior, guided.T_camera_object,
                                     0.5 * params.recogniser.ransac.inlier_px);
  }

  // Guided matches, confidence and p(o|c) at a pose.
  Track Judge(const rgbd::Frame& frame, features::Features features, const geometry::Rigid& T_camera_object, bool refine) const {
    Track track;
    const model::KeypointGrid grid(features.keypoints, frame.camera.width, frame.camera.height);
    recognition::GuidedParams guided_params;
    guided_params.radius_px = params.recogniser.guided_radius_px;
    guided_params.max_distance = params.recogniser.guided_max_distance;
    guided_params.inlier_px = params.recogniser.ransac.inlier_px;
    rgbd::Frame query = frame;
    if (!params.recogniser.use_query_depth) query.depth = cv::Mat();
    const auto guided = recognition::MatchGuided(*object, T_camera_object, query, features, grid, guided_params);
    track.matches = guided.matches;
    track.T_camera_object = refine ? Refined(query, features, guided) : T_camera_object;
    track.confidence = model::ObjectConfidence(*object, track.T_camera_object, query, grid, params.recogniser.confidence);
    track.probability = object->measures.observed.Probability(track.confidence.value);
    track.features = std::move(features);
    return track;
  }

  // Against the reference view alone, as in the paper.
  std::optional<Track> TrackReference(const rgbd::Frame& frame, features::Features features) const {
    const model::View& reference = object->views[reference_view];
    std::vector<pose::Match2d3d> matches;
    for (const features::Match& match :
         features::MatchRatio(features.descriptors, reference.features.descriptors, params.recogniser.max_ratio)) {
      const cv::Point2f& pixel = features.keypoints[match.query].pt;
      matches.push_back({{pixel.x, pixel.y}, object->points[reference.points[match.train]].position});
    }
    const auto estimate = pose::EstimatePose(matches, frame.camera, params.recogniser.use_query_depth ? &frame : nullptr,
                                             params.recogniser.ransac, params.recogniser.seed);
    if (!estimate || static_cast<int>(estimate->inliers.size()) < params.recogniser.min_inliers) return std::nullopt;
    return Judge(frame, std::move(features), estimate->T_camera_object, true);
  }

  // By the whole model, anywhere in the image.
  std::optional<Track> Relocalise(const rgbd::Frame& frame) const {
    features::Features features = recogniser.Extract(frame);
    const auto detections = recogniser.Recognise(frame, features);
    if (detections.empty()) return std::nullopt;
    return Judge(frame, std::move(features), detections.front().T_camera_object, true);
  }

  bool AgreesWithMount(const geometry::Rigid& T_camera_object, const geometry::Rigid& expected) const {
    const geometry::PoseDifference difference = geometry::Difference(T_camera_object, expected);
    return difference.translation_m <= params.max_mount_translation_m &&
           difference.rotation_rad <= params.max_mount_rotation_deg * M_PI / 180.0;
  }

  bool ContradictsMount(const rgbd::Frame& frame, const geometry::Rigid& T_camera_object) const {
    const auto expected = MountPose(frame);
    return params.require_mount_agreement && expected && !AgreesWithMount(T_camera_object, *expected);
  }

  // A pose that was found without the mount and agrees with it is right far more often than one that is merely as confident.
  void CreditAgreement(const rgbd::Frame& frame, std::optional<Track>* track) const {
    const auto expected = MountPose(frame);
    if (!*track || !expected || !AgreesWithMount((*track)->T_camera_object, *expected)) return;
    (*track)->probability = object->measures.observed.Probability((*track)->confidence.value, params.agreement_prior);
  }

  bool IsGood(const rgbd::Frame& frame, const std::optional<Track>& track) const {
    return track && track->probability >= kSeen && !ContradictsMount(frame, track->T_camera_object);
  }

  // The reference view first, then the whole model where the mount says it is, then the whole model anywhere.
  std::optional<Track> Find(const rgbd::Frame& frame) const {
    const auto mount_pose = MountPose(frame);
    const auto expected = mount_pose ? mount_pose : last_pose;
    if (expected && reference_view >= 0) {
      const features::Features features =
          features::Extract(rgbd::Gray(frame), RegionOfInterest(frame, expected), params.recogniser.features);
      auto track = TrackReference(frame, features);
      CreditAgreement(frame, &track);
      if (IsGood(frame, track)) return track;
      if (mount_pose) track = Judge(frame, features, *mount_pose, true);
      if (mount_pose && static_cast<int>(track->matches.size()) >= params.recogniser.min_inliers && IsGood(frame, track))
        return track;
    }
    auto track = Relocalise(frame);
    CreditAgreement(frame, &track);
    return track;
  }

  // --- New views ---

  bool IsNewDirection(const geometry::Rigid& T_camera_object) const {
    const Eigen::Vector3d camera = T_camera_object.inverse().translation();
    return std::all_of(object->views.begin(), object->views.end(), [&](const model::View& view) {
      const measures::Viewpoint old = view.viewpoint();
      return geometry::AngleBetween(camera, old.direction) > params.min_view_angle_deg * M_PI / 180.0 ||
             std::abs(std::log2(camera.norm() / old.distance_m)) > 1.0 / 3.0;
    });
  }

  // Empty where a view was added, else why not.
  std::string AddView(const rgbd::Frame& frame, const Track& track, bool pose_is_known) {
    if (track.confidence.value >= params.new_view_confidence) return "well known from here";
    if (!pose_is_known && track.probability < params.min_track_probability) return "not sure enough to learn";
    if (!pose_is_known && !IsNewDirection(track.T_camera_object)) return "too near to a learned view";
    if (!Segment(frame)) return "no table plane";
    const int cluster = ClusterOfObject(clusters, *object, track.T_camera_object, frame.camera);
    if (cluster < 0) return "no cluster where the object is";
    auto extended = WithView(*object, frame, clusters[cluster].mask, track.features, track.T_camera_object, track.matches,
                             params.min_view_points);
    if (!extended) return "too few interest points with depth on the object";
    Adopt(std::move(*extended));
    return "";
  }

  LearnerResult Continue(const rgbd::Frame& frame, const std::optional<geometry::Rigid>& known_pose) {
    LearnerResult result;
    std::optional<Track> track = known_pose ? Judge(frame, recogniser.Extract(frame), *known_pose, false) : Find(frame);
    const bool contradicted = track && !known_pose && ContradictsMount(frame, track->T_camera_object);
    if (track) {
      result.confidence = track->confidence;
      result.probability = track->probability;
      result.inliers = static_cast<int>(track->matches.size());
    }
    if (!track || contradicted || (!known_pose && track->probability < kSeen)) {
      state = result.state = state == State::kTracking ? State::kRelocalising : State::kLost;
      last_pose.reset();
      result.note = contradicted ? "the track contradicts the mount's pose" : "the object was not found";
      return result;
    }
    state = result.state = State::kTracking;
    last_pose = track->T_camera_object;
    if (!T_world_object && frame.T_world_camera) T_world_object = *frame.T_world_camera * track->T_camera_object;
    result.T_camera_object = track->T_camera_object;
    result.note = AddView(frame, *track, known_pose.has_value());
    result.view_added = result.note.empty();
    reference_view = result.view_added ? static_cast<int>(object->views.size()) - 1
                                       : (track->confidence.view >= 0 ? track->confidence.view : reference_view);
    result.reference_view = reference_view;
    return result;
  }
};

Learner::Learner(const LearnerParams& params, const std::string& name, std::shared_ptr<const model::ObjectModel> known) {
  params.Check();
  impl_ = std::make_unique<Impl>(params, name);
  if (!known) return;
  impl_->Adopt(*known);
  impl_->state = State::kRelocalising;
}
Learner::~Learner() = default;
Learner::Learner(Learner&&) noexcept = default;
Learner& Learner::operator=(Learner&&) noexcept = default;

LearnerResult Learner::Process(const rgbd::Frame& frame, const Target& target, const std::optional<geometry::Rigid>& known_pose) {
  rgbd::CheckFrame(frame);
  return impl_->object ? impl_->Continue(frame, known_pose) : impl_->Start(frame, target, known_pose);
}

std::shared_ptr<const model::ObjectModel> Learner::object() const { return impl_->object; }

void Learner::SetMeasures(const measures::Measures& measures) {
  if (!impl_->object) return;
  model::ObjectModel changed = *impl_->object;
  changed.measures = measures;
  impl_->Adopt(std::move(changed));
}

const std::optional<segmentation::Plane>& Learner::plane() const { return impl_->plane; }
const std::vector<segmentation::Cluster>& Learner::clusters() const { return impl_->clusters; }
std::optional<geometry::Rigid> Learner::T_world_object() const { return impl_->T_world_object; }

}  // namespace vantage::learning
