// Follows one known object: interest points where it can be, the pose against a reference view, and what speaks for it
// (section III).
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "learning/keyframe.h"
#include "learning/params.h"
#include "model/confidence.h"
#include "model/object_model.h"
#include "pose/refine.h"
#include "recognition/guided.h"

namespace vantage::learning {

// A pose of the object in a frame, with what speaks for it.
struct Track {
  geometry::Rigid T_camera_object = geometry::Rigid::Identity();
  features::Features features;  // Of the frame, where the object was sought.
  std::vector<recognition::GuidedMatch> matches;
  model::Confidence confidence;
  double probability = 0.0;                 // p(o|c).
  pose::PoseSpread spread;                  // How well matches, surface and texture hold the pose.
  std::optional<double> likeness;           // Of the object there to its learned views; see pose::DenseFit.
  std::optional<double> surface_agreement;  // Likewise of its surface.
};

// Where the object can be in a frame that was not looked at yet.
struct Expectation {
  geometry::Rigid T_camera_object = geometry::Rigid::Identity();
  double margin_px = 0.0;  // Around its projection.
  bool steady = false;     // The last frames lead there, without a gap.
};

// Not for several threads at once.
class Tracker {
 public:
  explicit Tracker(const LearnerParams& params)
      : params_(params),
        appearances_(std::make_unique<AppearanceCache>(params.surface_views, params.surface_samples, params.texture_samples)) {}

  // The frame's features inside the expected outline. Empty where that is outside the image.
  features::Features ExtractAround(const model::ObjectModel& object, const rgbd::Frame& frame,
                                   const Expectation& expectation) const;

  // Against one view alone, as in the paper: descriptors matched, P3P inside RANSAC, then At() its pose. nullopt where too few
  // matches agree. `mount_pose`: T_camera_object as the mount says, where it says; a pose that agrees with it is drawn to it.
  std::optional<Track> AgainstView(const model::ObjectModel& object, int view, const rgbd::Frame& frame,
                                   const features::Features& features, const std::optional<geometry::Rigid>& mount_pose) const;

  // Guided matches, confidence and p(o|c) at a pose; `refine` lets the pose follow the matches, the depth image, the colour image
  // and the mount.
  Track At(const model::ObjectModel& object, const rgbd::Frame& frame, const features::Features& features,
           const geometry::Rigid& T_camera_object, bool refine, const std::optional<geometry::Rigid>& mount_pose) const;

  // What the views nearest to a pose show, object frame.
  pose::Appearance AppearanceAt(const model::ObjectModel& object, const geometry::Rigid& T_camera_object) const {
    return appearances_->Near(object, T_camera_object);
  }

  bool Agree(const geometry::Rigid& T_camera_object_a, const geometry::Rigid& T_camera_object_b) const;

 private:
  struct Evidence;
  Evidence EvidenceIn(const rgbd::Frame& frame, const features::Features& features, const model::ObjectModel& object,
                      const recognition::GuidedPose& guided) const;
  geometry::Rigid Refined(const rgbd::Frame& frame, const Evidence& evidence, const geometry::Rigid& T_camera_object,
                          const std::optional<geometry::Rigid>& mount_pose) const;
  void Weigh(const rgbd::Frame& frame, const Evidence& evidence, Track* track) const;  // Its spread and likeness.

  LearnerParams params_;
  std::unique_ptr<AppearanceCache> appearances_;
};

}  // namespace vantage::learning
