#include "learning/view_choice.h"

#include <algorithm>
#include <cmath>

#include "learning/model_edit.h"

namespace vantage::learning {
namespace {

constexpr double kRadians = M_PI / 180.0;

// Points ought to be seen and hardly one is: the picture, not the side, is plain.
bool IsSpoiled(const model::Confidence& confidence, const LearnerParams& params) {
  return confidence.visible >= params.recogniser.confidence.min_points && confidence.value < params.min_plain_confidence;
}

}  // namespace

Hold HoldOf(const Sighting& sighting, const LearnerParams& params) {
  if (sighting.agrees_with_mount) return Hold::kFirm;
  const Track& track = sighting.track;
  const double spread_deg = track.spread.sigma_rad / kRadians;
  if (track.spread.sigma_m > params.max_spread_m || track.likeness.value_or(1.0) < params.min_likeness) return Hold::kNone;
  if (static_cast<int>(track.matches.size()) >= params.min_links && spread_deg <= params.max_spread_deg) return Hold::kFirm;
  if (IsSpoiled(track.confidence, params)) return Hold::kNone;
  return sighting.continued && spread_deg <= params.max_plain_spread_deg ? Hold::kPlain : Hold::kNone;
}

bool IsNewDirection(const model::ObjectModel& object, const Track& track, Hold hold, const LearnerParams& params) {
  const Eigen::Vector3d camera = track.T_camera_object.inverse().translation();
  const double familiar = hold == Hold::kPlain ? 1.0 : std::clamp(track.confidence.value / params.new_view_confidence, 0.5, 1.0);
  const double min_angle_rad = familiar * params.min_view_angle_deg * kRadians;
  return std::all_of(object.views.begin(), object.views.end(), [&](const model::View& view) {
    const measures::Viewpoint old = view.viewpoint();
    return geometry::AngleBetween(camera, old.direction) > min_angle_rad ||
           std::abs(std::log2(camera.norm() / old.distance_m)) > 1.0 / 3.0;
  });
}

bool ClosesLoop(const model::ObjectModel& object, const Track& track, const LearnerParams& params) {
  constexpr double kMaxAngle_rad = 25.0 * kRadians;
  const int newest = static_cast<int>(object.views.size()) - 1;
  const int seen = track.confidence.view;
  if (seen < 0 || newest - seen <= params.loop_closure.min_views_between) return false;
  if (static_cast<int>(track.matches.size()) < params.min_links) return false;
  const geometry::Rigid T_object_camera = track.T_camera_object.inverse();
  return geometry::AngleBetween(T_object_camera.translation(), object.views[newest].viewpoint().direction) < kMaxAngle_rad &&
         SharedPoints(object.views[newest], object.views[seen]) < params.refinement.min_shared_points;
}

ViewChoice ChooseView(const model::ObjectModel& object, const Sighting& sighting, const LearnerParams& params) {
  const Track& track = sighting.track;
  const bool known = sighting.pose_is_known;
  const bool closes_loop = !known && ClosesLoop(object, track, params);
  if (!closes_loop && track.confidence.value >= params.new_view_confidence) return {"well known from here"};
  if (!known && track.probability < params.min_track_probability) return {"not sure enough to learn"};
  const Hold hold = HoldOf(sighting, params);
  if (!known && hold == Hold::kNone) return {"the pose is not held well enough to learn"};
  if (!known && !closes_loop && !IsNewDirection(object, track, hold, params)) return {"too near to a learned view"};
  return {"", hold == Hold::kPlain ? 0 : params.min_view_points};
}

}  // namespace vantage::learning
