// Loop closure: an old view is seen again, and the same physical points become the same model points, which takes the drift out.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "learning/refinement.h"
#include "model/object_model.h"
#include "pose/ransac.h"

namespace vantage::learning {

// A false closure bends the whole model, a missed one costs little: everything here errs on the side of missing.
struct LoopClosureParams {
  double max_view_angle_deg = 40.0;  // Older views whose direction differs by less are tried (drift included); (0, 180].
  double max_octaves = 1.0;          // ...and whose distance differs by less; > 0.
  double max_shared = 0.15;          // ...and that share less than this share of points with the view (of the fewer); (0, 1].
  int min_views_between = 3;         // ...learned since: those just before were tracked, linked or not; >= 0.
  int max_candidates = 3;            // The nearest so many: bounds the time; >= 1.
  double max_ratio = 0.85;           // Best over second-best descriptor distance, both ways; (0, 1].
  pose::RansacParams ransac;         // Of the pose against the old view alone, whatever the model says it is.
  int min_inliers = 20;              // >= 6.
  double min_inlier_share = 0.25;    // Of the mutual matches; [0, 1].
  double min_spread = 0.1;           // Spread of the inliers in the narrow direction (SD), of the root of the object's area; >= 0.
  double max_drift_m = 0.05;         // The found pose differs from the model's by less; > 0.
  double max_drift_deg = 15.0;       // > 0.
  int surface_samples = 600;         // Of each view's depth, held against the other's; >= 50.
  double surface_tolerance_m = 0.012;  // Depths that agree; > 0.
  double min_surface_overlap = 0.3;    // Share of one view's samples that the other must measure in the same place; [0, 1].
  double max_surface_conflict = 0.08;  // Share of them that the other sees through or does not have on the object; [0, 1].
  double min_linked_inliers = 0.7;     // Share of the linked keypoints that agree after global refinement, else all is undone.
  std::uint32_t seed = 0;

  void Check() const;  // Throws std::invalid_argument naming the field.
};

// Keypoint `keypoint` of view `view` and model point `point` are the same physical point.
struct Link {
  int view = 0;      // Index into views.
  int keypoint = 0;  // Index into the view's features.
  int point = 0;     // Index into points.
};

// Why an older view was not linked, or that it was.
struct LinkAttempt {
  int view = 0;          // Index of the older view.
  int matches = 0;       // Mutual descriptor matches.
  int inliers = 0;       // Of the pose found from them.
  double drift_m = 0.0;  // How far that pose is from the model's.
  double drift_rad = 0.0;
  double surface_overlap = 0.0;   // The lesser of the two ways.
  double surface_conflict = 0.0;  // The greater.
  int links = 0;                  // 0 where it was refused.
};

// Links of the view to points of older views that the model does not know it shares. Every older view tried is verified on its own:
// a pose by P3P RANSAC from its points alone, not started from the model's, supported by many and well spread matches; not further
// from the model's than drift explains; and the depth images and outlines of both must agree under it both ways.
// Cost: about 10 ms per view tried.
std::vector<Link> FindLinks(const model::ObjectModel& object, int view, const LoopClosureParams& params,
                            std::vector<LinkAttempt>* attempts = nullptr);

// Whether the view shares points (`min_shared` or more) with an older view but hardly any with one learned between the two: the
// camera came back, and tracking has linked what it saw again. The loop is known then but its drift is not taken out yet: all views
// want refining, not the newest alone.
bool ComesBack(const model::ObjectModel& object, int view, int min_shared = 6);

// The model with linked points merged (the older point stays), unused points gone, indices renewed. A link is left out where some
// view sees both points at different pixels.
model::ObjectModel Linked(const model::ObjectModel& object, const std::vector<Link>& links);

struct ClosureReport {
  std::vector<LinkAttempt> attempts;
  int links = 0;
  double linked_inliers = 0.0;  // Share of the links that agree after refinement.
  RefinementReport refinement;
};

// The whole of it for a view: links found, points merged, everything refined, and the result taken only where the links agree with
// all that was known before. nullopt where there was nothing to close or the closure was refused.
// Cost: FindLinks + a global Refined where there are links.
std::optional<model::ObjectModel> WithLoopClosed(const model::ObjectModel& object, int view, const LoopClosureParams& params,
                                                 const RefinementParams& refinement, ClosureReport* report = nullptr);

}  // namespace vantage::learning
