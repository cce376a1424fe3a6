#include "learning/learner.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>

#include "learning/keyframe.h"
#include "learning/model_edit.h"
#include "learning/motion.h"
#include "learning/mount_witness.h"
#include "learning/refiner.h"
#include "learning/tracker.h"
#include "learning/view_choice.h"

namespace vantage::learning {
namespace {

constexpr double kSeen = 0.5;        // p(o|c) from which a pose counts as the object's.
constexpr int kWholeImageEvery = 3;  // Of the frames a lost object is sought in; in the others only about where it was followed to.

// Where depth must not help to place the object in a frame it must not help to refine views either.
LearnerParams WithoutDepthWhereNotWanted(LearnerParams params) {
  params.refinement.use_depth &= params.recogniser.use_query_depth;
  return params;
}

// A found pose and how it was found.
struct Found {
  Track track;
  bool followed = false;   // Where the last frames or the mount led; else by recognition.
  bool continued = false;  // Where the last frames led, and its surface is there.
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

struct Learner::Impl {
  LearnerParams params;
  std::string name;
  Tracker tracker;
  std::shared_ptr<const model::ObjectModel> object;
  recognition::Recogniser recogniser;
  recognition::Recogniser others;  // Objects met before, of which this may be one.
  std::map<std::string, std::shared_ptr<const model::ObjectModel>> other_objects;
  bool recogniser_is_current = false;  // It is told of a changed model only when it is needed.
  Refiner refiner;
  std::vector<PointStatistics> statistics;  // One per model point.
  std::int64_t frame_number = 0;
  State state = State::kSearching;
  int confirmations = 0;  // Frames that agreed since the object was found again.
  int reference_view = -1;
  Motion motion;
  std::optional<geometry::Rigid> followed_to;  // Where it was found last; none where frames did not lead there.
  int frames_sought = 0;                       // By the whole model, since.
  MountWitness mount;
  std::optional<segmentation::Plane> plane;
  std::vector<segmentation::Cluster> clusters;

  Impl(const LearnerParams& p, const std::string& object_name)
      : params(WithoutDepthWhereNotWanted(p)),
        name(object_name),
        tracker(p),
        recogniser(p.recogniser),
        others(p.recogniser),
        refiner(params),
        mount(params, tracker) {}

  void Adopt(model::ObjectModel changed) {
    object = std::make_shared<const model::ObjectModel>(std::move(changed));
    statistics.resize(object->points.size());
    recogniser_is_current = false;
  }

  const recognition::Recogniser& CurrentRecogniser() {
    if (!recogniser_is_current) recogniser.Set(object);
    recogniser_is_current = true;
    return recogniser;
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
    if (!known_pose && ContinuesAnother(frame, index)) return Continue(frame, std::nullopt);
    const cv::Mat& mask = clusters[index].mask;
    const geometry::Rigid T_camera_object = known_pose.value_or(FirstPose(frame, *plane, clusters[index]));
    const features::Features features = features::Extract(rgbd::Gray(frame), mask, params.recogniser.features);
    model::ObjectModel empty;
    empty.name = name;
    empty.feature_fingerprint = params.recogniser.features.Fingerprint();
    empty.measures.observed = others.Pooled();  // Until it has its own.
    auto first = WithView(empty, frame, mask, features, T_camera_object, {}, params.min_view_points);
    if (!first) {
      result.note = "too few interest points with depth on the object";
      return result;
    }
    Adopt(std::move(*first));
    mount.Note(frame, T_camera_object);
    motion.Found(*object, frame.camera, T_camera_object, frame.utime);
    reference_view = 0;
    state = result.state = State::kTracking;
    result.T_camera_object = T_camera_object;
    result.confidence.value = 1.0;
    result.probability = 1.0;
    result.reference_view = 0;
    result.view_added = true;
    return result;
  }

  // Whether what this cluster shows was met before; then its model is adopted.
  bool ContinuesAnother(const rgbd::Frame& frame, int cluster) {
    if (other_objects.empty()) return false;
    for (const recognition::Detection& detection : others.Recognise(frame, others.Extract(frame))) {
      const auto& other = other_objects.at(detection.object);
      if (detection.probability < params.min_track_probability) continue;
      if (ClusterOfObject(clusters, *other, detection.T_camera_object, frame.camera) != cluster) continue;
      name = detection.object;
      Adopt(*other);
      state = State::kLost;
      return true;
    }
    return false;
  }

  // --- Where the object is expected ---

  std::optional<Expectation> Expected(const rgbd::Frame& frame) const {
    const auto predicted = motion.Predicted(frame.utime);
    const auto mount_pose = mount.PoseIn(frame);
    if (!predicted && !mount_pose) return std::nullopt;
    Expectation expectation;
    expectation.T_camera_object = mount_pose ? *mount_pose : *predicted;
    const double size_px = Size_px(frame, expectation.T_camera_object);
    expectation.steady = !mount_pose && motion.IsSteady(frame.utime);
    expectation.margin_px =
        expectation.steady ? std::max(params.min_roi_margin_px, 3.0 * motion.error_px()) : params.roi_margin * size_px + 20.0;
    return expectation;
  }

  // How large it looks.
  double Size_px(const rgbd::Frame& frame, const geometry::Rigid& T_camera_object) const {
    return frame.camera.fx * Size() / std::max(0.05, T_camera_object.translation().norm());
  }

  // The longest side of the box around the model's points, metres.
  double Size() const {
    const Eigen::Matrix3Xd points = object->PointMatrix();
    if (points.cols() == 0) return 0.0;
    return (points.rowwise().maxCoeff() - points.rowwise().minCoeff()).maxCoeff();
  }

  // --- Tracking ---

  // Whether a pose is where the last frames lead, and the surface is measured there: the object has been followed to it, whatever
  // interest points say.
  bool Continues(const rgbd::Frame& frame, const Expectation& expectation, const Track& track) const {
    return expectation.steady && track.surface_agreement.value_or(0.0) >= params.min_surface_agreement &&
           IsNear(frame, expectation, track.T_camera_object);
  }

  // A pose that was found without the mount, or without the last frames, and agrees with them is right far more often than one that
  // is merely as confident.
  void CreditAgreement(const std::optional<geometry::Rigid>& expected, double prior, Track* track) const {
    if (!expected || !tracker.Agree(track->T_camera_object, *expected)) return;
    track->probability = object->measures.observed.Probability(track->confidence.value, prior);
  }

  bool IsGood(const rgbd::Frame& frame, const Track& track) const {
    return track.probability >= kSeen && !mount.Contradicts(frame, track.T_camera_object);
  }

  // The reference view and the views beside it.
  std::vector<int> ViewsToTry(const geometry::Rigid& expected) const {
    std::vector<int> views = {reference_view};
    for (const int view : model::NearestViews(*object, expected, params.neighbour_views + 1)) {
      if (view != reference_view && static_cast<int>(views.size()) <= params.neighbour_views) views.push_back(view);
    }
    return views;
  }

  // Around where it is expected: the reference view first, its neighbours, then the whole model where the mount or a steady motion
  // says it is.
  std::optional<Found> Follow(const rgbd::Frame& frame, const Expectation& expectation) const {
    const auto mount_pose = mount.PoseIn(frame);
    const features::Features features = tracker.ExtractAround(*object, frame, expectation);
    const auto judged = [&](Found found) {
      found.continued = Continues(frame, expectation, found.track);
      found.followed = IsNear(frame, expectation, found.track.T_camera_object);
      CreditAgreement(expectation.T_camera_object, found.continued ? params.surface_prior : params.agreement_prior, &found.track);
      return found;
    };
    for (const int view : ViewsToTry(expectation.T_camera_object)) {
      if (features.size() < params.recogniser.min_inliers) break;
      auto track = tracker.AgainstView(*object, view, frame, features, mount_pose);
      if (!track) continue;
      const Found found = judged({std::move(*track)});
      if (IsGood(frame, found.track)) return found;
    }
    if (!mount_pose && !expectation.steady) return std::nullopt;
    const Found found = judged({tracker.At(*object, frame, features, expectation.T_camera_object, true, mount_pose)});
    const bool held = found.continued || static_cast<int>(found.track.matches.size()) >= params.recogniser.min_inliers;
    return held && IsGood(frame, found.track) ? std::optional<Found>(found) : std::nullopt;
  }

  // By the whole model: about where it was followed to, which is quick; every few frames, and where frames did not lead to it,
  // anywhere in the image.
  std::optional<Track> Relocalise(const rgbd::Frame& frame) {
    const bool near = followed_to && ++frames_sought % kWholeImageEvery != 0;
    const features::Features features =
        near ? tracker.ExtractAround(*object, frame, {*followed_to, 0.5 * Size_px(frame, *followed_to), false})
             : CurrentRecogniser().Extract(frame);
    const auto detections = CurrentRecogniser().Recognise(frame, features);
    if (detections.empty()) return std::nullopt;
    Track track = tracker.At(*object, frame, features, detections.front().T_camera_object, true, mount.PoseIn(frame));
    CreditAgreement(mount.PoseIn(frame), params.agreement_prior, &track);
    return track;
  }

  // Whether a pose is where it was searched for. Further away it jumped: what led there is no witness for it.
  bool IsNear(const rgbd::Frame& frame, const Expectation& expectation, const geometry::Rigid& T_camera_object) const {
    constexpr double kMaxTurn_rad = 20.0 * M_PI / 180.0;
    return geometry::Difference(expectation.T_camera_object, T_camera_object).rotation_rad <= kMaxTurn_rad &&
           LargestShift(*object, frame.camera, expectation.T_camera_object, T_camera_object) <= 2.0 * expectation.margin_px;
  }

  std::optional<Found> Find(const rgbd::Frame& frame) {
    const auto expectation = Expected(frame);
    if (expectation && reference_view >= 0) {
      if (auto found = Follow(frame, *expectation)) return found;
    }
    if (auto track = Relocalise(frame)) return Found{std::move(*track)};
    return std::nullopt;
  }

  // --- Surely tracking, or not ---

  // The state after the object was found.
  State StateOf(const rgbd::Frame& frame, const Found& found) {
    if (state == State::kTracking && found.followed) return State::kTracking;
    const bool sure = found.track.probability >= params.sure_probability || mount.Agrees(frame, found.track.T_camera_object);
    confirmations = found.followed ? confirmations + 1 : 0;
    return sure || confirmations >= params.confirm_frames ? State::kTracking : State::kRelocalising;
  }

  LearnerResult Lose(LearnerResult result, const std::string& note) {
    state = result.state = State::kLost;
    motion.Lost();
    result.note = note;
    return result;
  }

  // --- Refinement ---

  void StartRefinement() {
    if (params.refine && refiner.IsDue()) refiner.Start(frame_number, object, statistics, mount.Priors(*object));
  }

  // The refined model, with what was learned since, in place of the one there is.
  void TakeEffect(const Refinement& refinement) {
    std::vector<int> new_index;
    const int reference_id = reference_view >= 0 ? object->views[reference_view].id : -1;
    model::ObjectModel rebased = Rebased(*refinement.base, refinement.changed, *object, &new_index);
    std::vector<PointStatistics> moved(rebased.points.size());
    for (size_t p = 0; p < new_index.size(); ++p) {
      if (new_index[p] < 0) continue;
      moved[new_index[p]].visible += statistics[p].visible;
      moved[new_index[p]].seen += statistics[p].seen;
    }
    statistics = std::move(moved);
    if (reference_id >= 0) {
      const geometry::Rigid change = ChangeOf(*object, rebased, reference_id).inverse();
      motion.ChangeObject(change);
      if (followed_to) followed_to = *followed_to * change;
    }
    Adopt(std::move(rebased));
    reference_view = IndexOfView(*object, reference_id);
    if (reference_view < 0 && motion.last()) reference_view = model::NearestViews(*object, *motion.last(), 1).front();
  }

  // How the points fare that ought to be seen in a frame the object is surely tracked in.
  void CountSightings(const rgbd::Frame& frame, const Track& track) {
    for (const int view : model::NearestViews(*object, track.T_camera_object, 1)) {
      for (const int point : object->views[view].points) {
        const model::ModelPoint& p = object->points[point];
        const Eigen::Vector3d in_camera = track.T_camera_object * p.position;
        const auto pixel = frame.camera.Project(in_camera);
        if (!pixel || !frame.camera.Contains(*pixel)) continue;
        if (-(track.T_camera_object.linear() * p.normal).dot(in_camera.normalized()) < 0.5) continue;
        const auto depth = rgbd::DepthAt(frame, *pixel, 0);
        if (depth && *depth < in_camera.z() - params.recogniser.confidence.occlusion_m) continue;
        ++statistics[point].visible;
      }
    }
    for (const recognition::GuidedMatch& match : track.matches) ++statistics[match.point].seen;
  }

  // --- New views ---

  // Empty where a view was added, else why not.
  std::string AddView(const rgbd::Frame& frame, const Found& found, bool pose_is_known) {
    const Track& track = found.track;
    const Sighting sighting{track, found.continued, mount.Agrees(frame, track.T_camera_object), pose_is_known};
    const ViewChoice choice = ChooseView(*object, sighting, params);
    if (!choice.refusal.empty()) return choice.refusal;
    if (!Segment(frame)) return "no table plane";
    const int cluster = ClusterOfObject(clusters, *object, track.T_camera_object, frame.camera);
    if (cluster < 0) return "no cluster where the object is";
    auto extended =
        WithView(*object, frame, clusters[cluster].mask, track.features, track.T_camera_object, track.matches, choice.min_points);
    if (!extended) return "too few interest points with depth on the object";
    Adopt(std::move(*extended));
    return "";
  }

  // Follows the object through a frame whose pose was found.
  LearnerResult Advance(const rgbd::Frame& frame, const Found& found, LearnerResult result, bool pose_is_known) {
    const Track& track = found.track;
    motion.Found(*object, frame.camera, track.T_camera_object, frame.utime);
    if (state == State::kTracking) mount.Note(frame, track.T_camera_object);
    result.T_camera_object = track.T_camera_object;
    result.note = state == State::kTracking ? AddView(frame, found, pose_is_known) : "found again, not yet surely";
    result.view_added = result.note.empty();
    if (state == State::kTracking && !pose_is_known) CountSightings(frame, track);
    if (result.view_added) {
      if (!pose_is_known) refiner.ViewAdded(object->views.back().id);
      reference_view = static_cast<int>(object->views.size()) - 1;
    } else if (track.confidence.view >= 0) {
      reference_view = track.confidence.view;  // The view that explains the frame best.
    }
    result.reference_view = reference_view;
    return result;
  }

  LearnerResult Continue(const rgbd::Frame& frame, const std::optional<geometry::Rigid>& known_pose) {
    LearnerResult result;
    std::optional<Found> found;
    if (known_pose) {
      found = Found{tracker.At(*object, frame, CurrentRecogniser().Extract(frame), *known_pose, false, std::nullopt), true};
    } else {
      found = Find(frame);
    }
    if (!found) return Lose(result, "the object was not found");
    const Track& track = found->track;
    result.confidence = track.confidence;
    result.probability = track.probability;
    result.inliers = static_cast<int>(track.matches.size());
    result.spread = track.spread;
    result.likeness = track.likeness;
    if (!known_pose && mount.Contradicts(frame, track.T_camera_object) && !mount.WasMoved(frame, *object, track)) {
      return Lose(result, "the track contradicts the mount's pose");
    }
    if (!known_pose && track.probability < kSeen) return Lose(result, "the object was not found");
    followed_to = found->followed ? std::optional(track.T_camera_object) : std::nullopt;
    frames_sought = 0;
    state = result.state = known_pose ? State::kTracking : StateOf(frame, *found);
    return Advance(frame, *found, result, known_pose.has_value());
  }
};

Learner::Learner(const LearnerParams& params, const std::string& name, std::shared_ptr<const model::ObjectModel> known) {
  params.Check();
  impl_ = std::make_unique<Impl>(params, name);
  if (!known) return;
  impl_->Adopt(*known);
  impl_->state = State::kLost;
}
Learner::~Learner() = default;
Learner::Learner(Learner&&) noexcept = default;
Learner& Learner::operator=(Learner&&) noexcept = default;

LearnerResult Learner::Process(const rgbd::Frame& frame, const Target& target, const std::optional<geometry::Rigid>& known_pose) {
  rgbd::CheckFrame(frame);
  const auto refinement = impl_->refiner.Take(++impl_->frame_number);
  if (refinement) impl_->TakeEffect(*refinement);
  LearnerResult result = impl_->object ? impl_->Continue(frame, known_pose) : impl_->Start(frame, target, known_pose);
  result.refined = refinement.has_value();
  if (impl_->object) impl_->StartRefinement();
  return result;
}

void Learner::SetOthers(const std::vector<std::shared_ptr<const model::ObjectModel>>& others) {
  for (const auto& other : others) {
    impl_->others.Set(other);
    impl_->other_objects[other->name] = other;
  }
}

const std::string& Learner::name() const { return impl_->name; }

std::shared_ptr<const model::ObjectModel> Learner::object() const { return impl_->object; }

bool Learner::FinishRefinement() {
  bool changed = false;
  if (!impl_->object) return changed;
  // Views may have come in while the last job ran: they are owed one of their own.
  for (impl_->StartRefinement();; impl_->StartRefinement()) {
    const auto refinement = impl_->refiner.Finish();
    if (!refinement) break;
    impl_->TakeEffect(*refinement);
    changed = true;
  }
  if (!impl_->params.refine || impl_->refiner.views_added() == 0) return changed;
  impl_->TakeEffect(impl_->refiner.RefineAll(impl_->object, impl_->mount.Priors(*impl_->object)));
  return true;
}

void Learner::SetMeasures(const measures::Measures& measures) {
  if (!impl_->object) return;
  model::ObjectModel changed = *impl_->object;
  changed.measures = measures;
  impl_->Adopt(std::move(changed));
}

const std::optional<segmentation::Plane>& Learner::plane() const { return impl_->plane; }
const std::vector<segmentation::Cluster>& Learner::clusters() const { return impl_->clusters; }
std::optional<geometry::Rigid> Learner::T_world_object() const { return impl_->mount.T_world_object(); }

}  // namespace vantage::learning
