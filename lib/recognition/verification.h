// Which hypotheses can be true: with the depth image, and beside each other (section IV-C).
#pragma once

#include <vector>

#include "model/object_model.h"
#include "rgbd/frame.h"

namespace vantage::recognition {

struct VerificationParams {
  double max_seen_through = 0.5;  // Share of a pose's points that are not hidden through which the depth image sees; [0, 1].
  double merge_distance = 0.3;    // Poses of one object nearer than this (mean point distance over its radius) are one; >= 0.
  double min_own_share = 0.5;     // Of a hypothesis's interest points, those that speak for it beside better ones; [0, 1].
  int max_instances = 3;          // Of one object in one frame; >= 1.

  void Check() const;  // Throws std::invalid_argument naming the field.
};

// What the depth image says of the object's points that face the camera: the surface is measured there, something in front of it
// hides it, or what is measured lies behind it, so that the object cannot be there.
struct DepthEvidence {
  int supported = 0;
  int hidden = 0;
  int seen_through = 0;
};

// Of the points of the nearest views, those that lie in the image and have a measured depth. Cost: about 0.1 ms.
DepthEvidence CompareDepth(const model::ObjectModel& object, const geometry::Rigid& T_camera_object, const rgbd::Frame& frame,
                           double max_depth_error_m);

// Whether the depth image speaks against the object: it is seen through, or nothing of it is seen.
bool IsContradicted(const DepthEvidence& evidence, const VerificationParams& params);

// A pose and the interest points it explains.
struct Hypothesis {
  const model::ObjectModel* object = nullptr;
  geometry::Rigid T_camera_object = geometry::Rigid::Identity();
  std::vector<int> keypoints;           // Of the frame's features; each once.
  std::vector<Eigen::Vector2d> pixels;  // Of these.
  std::vector<double> depths_m;         // Of these: where the pose puts the object's surface, z in the camera.
};

// Those that can be true together, as indices, what explains more first: more of the image (squares of it that hold an explained
// point), for a phantom on one repeated detail may have many points close together. The first is taken. Another is left out where
// it is the same object at nearly the same pose, or where of its points fewer than `min_points` (or min_own_share) speak for it:
// its own, those that nothing taken explains or would hide, less those of what was taken that it would itself hide. So an object in
// front of another stays, and one seen through another goes. Cost: about 0.1 ms each, quadratic where they overlap.
std::vector<int> ResolveConflicts(const std::vector<Hypothesis>& hypotheses, const geometry::PinholeCamera& camera, int min_points,
                                  const VerificationParams& params);

}  // namespace vantage::recognition
