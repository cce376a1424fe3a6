#include "learning/mount_witness.h"

#include <cmath>

namespace vantage::learning {

std::optional<geometry::Rigid> MountWitness::PoseIn(const rgbd::Frame& frame) const {
  if (!frame.T_world_camera || !T_world_object_) return std::nullopt;
  return frame.T_world_camera->inverse() * *T_world_object_;
}

bool MountWitness::Agrees(const rgbd::Frame& frame, const geometry::Rigid& T_camera_object) const {
  const auto expected = PoseIn(frame);
  return expected && tracker_.Agree(T_camera_object, *expected);
}

bool MountWitness::Contradicts(const rgbd::Frame& frame, const geometry::Rigid& T_camera_object) const {
  return params_.require_mount_agreement && PoseIn(frame) && !Agrees(frame, T_camera_object);
}

void MountWitness::Note(const rgbd::Frame& frame, const geometry::Rigid& T_camera_object) {
  if (!T_world_object_ && frame.T_world_camera) T_world_object_ = *frame.T_world_camera * T_camera_object;
}

// Whether the depth image looks through most of the surface that should be seen at a pose.
bool MountWitness::IsGone(const rgbd::Frame& frame, const model::ObjectModel& object,
                          const geometry::Rigid& T_camera_object) const {
  constexpr int kMinSamples = 50;
  constexpr double kBehind_m = 0.03;
  int seen = 0, behind = 0;
  for (const pose::SurfacePoint& sample : tracker_.AppearanceAt(object, T_camera_object).surface) {
    const Eigen::Vector3d point = T_camera_object * sample.point;
    if ((T_camera_object.linear() * sample.normal).dot(point.normalized()) > -0.2) continue;
    const auto pixel = frame.camera.Project(point);
    const auto depth = pixel ? rgbd::DepthAt(frame, *pixel, 1) : std::nullopt;
    if (!depth) continue;
    ++seen;
    behind += *depth > point.z() + kBehind_m;
  }
  return seen >= kMinSamples && 2 * behind > seen;
}

bool MountWitness::WasMoved(const rgbd::Frame& frame, const model::ObjectModel& object, const Track& track) {
  if (track.probability < params_.min_track_probability || !IsGone(frame, object, *PoseIn(frame))) {
    elsewhere_ = 0;
    return false;
  }
  const geometry::Rigid T_world_found = *frame.T_world_camera * track.T_camera_object;
  elsewhere_ = T_world_elsewhere_ && tracker_.Agree(T_world_found, *T_world_elsewhere_) ? elsewhere_ + 1 : 1;
  T_world_elsewhere_ = T_world_found;
  if (elsewhere_ < params_.moved_frames) return false;
  T_world_object_ = T_world_found;
  elsewhere_ = 0;
  return true;
}

std::map<int, pose::PosePrior> MountWitness::Priors(const model::ObjectModel& object) const {
  std::map<int, pose::PosePrior> priors;
  for (const model::View& view : object.views) {
    if (!Agrees(view.keyframe, view.T_camera_object)) continue;
    priors[view.id] = {*PoseIn(view.keyframe), params_.mount_sigma_m, params_.mount_sigma_deg * M_PI / 180.0};
  }
  return priors;
}

}  // namespace vantage::learning
