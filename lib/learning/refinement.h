// Refinement of a learned model: poses of its views and positions of its points together (section III).
//
// All functions are pure: a model in, a model out. Images and descriptors are shared, not copied.
#pragma once

#include <optional>
#include <vector>

#include "model/object_model.h"
#include "pose/bundle.h"
#include "pose/dense.h"

namespace vantage::learning {

struct RefinementParams {
  pose::BundleParams bundle;
  pose::DenseParams dense;
  int surface_samples = 300;           // Of each view's depth, drawn to its neighbours' depth images; 0 = none.
  int texture_samples = 600;           // Of each view's texture, drawn to its neighbours' colour images; 0 = none.
  int related_views = 6;               // A free view is held against so many others, those that share most points; >= 1.
  int min_shared_points = 6;           // ...if they share so many; >= 1.
  double min_likeness = 0.9;           // Pairs that share too few points must look so much alike where they are; [-1, 1].
  double max_relation_move_m = 0.008;  // What wants a pair of views further from where points put them is not believed; > 0.
  bool use_depth = true;               // false: only the first view's is used (it gives the scale), all else is pixels.
  double max_link_error_sigmas = 8.0;  // A view that is so far off from a point it is said to see saw another one; > 0.

  void Check() const;  // Throws std::invalid_argument naming the field.
};

struct RefinementReport {
  pose::BundleReport bundle;
  int relations = 0;         // Pairs of views whose surfaces were fitted to each other.
  int unlinked = 0;          // Keypoints that were found to have seen another point than said.
  double max_moved_m = 0.0;  // The farthest a view's T_camera_object moved.
  double max_turned_rad = 0.0;
};

// The model with its views from index `first_free_view` on refined against all others, which stay: 1 = all but the first (global),
// views.size() - k = the newest k (local). At least the first view always stays: it says where the object frame is. Points that two
// or more views see are refined as well; a point that one view sees moves rigidly with it. Points alone come first; then, where
// surface_samples > 0, the depth images of neighbouring views are fitted to each other and all is adjusted once more: what little
// texture leaves open, the surface may know. A keypoint that disagrees with its point
// grossly afterwards gets a point of its own where its depth was measured, and is dropped where it was not.
//
// `priors`: one per view or none at all; where something else (a mount) says the object is.
// Cost: see pose::AdjustBundle; local about 20 ms, global about 0.3 s for 40 views of 300 features on one core.
model::ObjectModel Refined(const model::ObjectModel& object, int first_free_view, const RefinementParams& params,
                           RefinementReport* report = nullptr, const std::vector<std::optional<pose::PosePrior>>& priors = {});

// The last step of it alone: keypoints of views from `first_free_view` on that are more than max_link_error_sigmas off.
model::ObjectModel WithoutWrongLinks(const model::ObjectModel& object, int first_free_view, const RefinementParams& params,
                                     int* unlinked = nullptr);

// What a change did to object coordinates as this view has them: maps points of `before` to where `after` (made from it by any
// functions of this folder) puts them. Where the view is gone, by the one that shares most points with it. A pose tracked against
// the view becomes T_camera_object * ChangeOf(...).inverse(). Throws std::invalid_argument where before has no view of this id.
geometry::Rigid ChangeOf(const model::ObjectModel& before, const model::ObjectModel& after, int view_id);

// The change from `base` to `changed` (refined, linked, thinned out: by any functions of this folder) applied to `current`, which
// is base with more views and points appended since. Views since then, and points only they see, move rigidly with the nearest
// view. Measures and name are current's. `new_index`: where each point of current went, -1 = dropped. Throws std::invalid_argument
// where current is not base with something appended.
model::ObjectModel Rebased(const model::ObjectModel& base, const model::ObjectModel& changed, const model::ObjectModel& current,
                           std::vector<int>* new_index = nullptr);

}  // namespace vantage::learning
