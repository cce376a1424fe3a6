// Guided matching: with a pose at hand, model points look for their interest point near their projection only.
#pragma once

#include <vector>

#include "features/features.h"
#include "model/confidence.h"
#include "model/object_model.h"
#include "pose/ransac.h"

namespace vantage::recognition {

struct GuidedParams {
  double radius_px = 8.0;      // How far from its projection a point is sought; > 0.
  double max_distance = 0.65;  // Descriptor distance of a match; (0, 2].
  double inlier_px = 3.0;      // Reprojection error of a match that supports the refined pose; > 0.
  int views = 4;               // Nearest views whose points are used; >= 1.
  int min_matches = 6;         // Fewer do not move the pose: they are wrong too often; >= 3.
};

struct GuidedMatch {
  int keypoint = 0;       // Of the frame's features.
  int view = 0;           // Of the model.
  int view_keypoint = 0;  // Of that view's features.
  int point = 0;          // Model point.
};

struct GuidedPose {
  geometry::Rigid T_camera_object = geometry::Rigid::Identity();
  std::vector<GuidedMatch> matches;  // Those that support the refined pose; each keypoint once.
};

// `frame` gives the camera and, where it has depth, the measured depth that refinement uses as well.
// Two rounds of matching, and of refinement where there are enough matches, from `T_camera_object`. Points that face away by more
// than 80 degrees are left out.
GuidedPose MatchGuided(const model::ObjectModel& object, const geometry::Rigid& T_camera_object, const rgbd::Frame& frame,
                       const features::Features& features, const model::KeypointGrid& grid, const GuidedParams& params);

}  // namespace vantage::recognition
