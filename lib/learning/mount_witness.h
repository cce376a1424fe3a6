// What the mount knows, where its pose comes with the frames: where a standing object must be, and whether it was moved.
#pragma once

#include <map>
#include <optional>

#include "learning/tracker.h"

namespace vantage::learning {

class MountWitness {
 public:
  // `tracker` must outlive this; it says when two poses agree and what the object's surface is.
  MountWitness(const LearnerParams& params, const Tracker& tracker) : params_(params), tracker_(tracker) {}

  // Where the mount says the object is (T_camera_object); nullopt where the frame's pose, or the object's place, is not known.
  std::optional<geometry::Rigid> PoseIn(const rgbd::Frame& frame) const;
  bool Agrees(const rgbd::Frame& frame, const geometry::Rigid& T_camera_object) const;
  // Whether it speaks against a pose, and is to be heard.
  bool Contradicts(const rgbd::Frame& frame, const geometry::Rigid& T_camera_object) const;

  // The object is surely there: its place in the world, where that was not known yet.
  void Note(const rgbd::Frame& frame, const geometry::Rigid& T_camera_object);
  // The object was found where, by the mount, it is not. Seen gone from its place and found in one other place again and again, it
  // was moved: its place is there from now on.
  bool WasMoved(const rgbd::Frame& frame, const model::ObjectModel& object, const Track& track);

  // Where the mount says the object is in each view (by its id) that was taken with the mount's pose known and agrees with it.
  std::map<int, pose::PosePrior> Priors(const model::ObjectModel& object) const;

  const std::optional<geometry::Rigid>& T_world_object() const { return T_world_object_; }

 private:
  bool IsGone(const rgbd::Frame& frame, const model::ObjectModel& object, const geometry::Rigid& T_camera_object) const;

  const LearnerParams& params_;
  const Tracker& tracker_;
  std::optional<geometry::Rigid> T_world_object_;
  std::optional<geometry::Rigid> T_world_elsewhere_;  // Where it was found while it was gone from there.
  int elsewhere_ = 0;                                 // So many times in a row.
};

}  // namespace vantage::learning
