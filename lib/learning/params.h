// Every threshold of the online learner, in one place; the paper's values where it names one.
#pragma once

#include "learning/loop_closure.h"
#include "learning/refinement.h"
#include "learning/upkeep.h"
#include "recognition/recogniser.h"
#include "segmentation/clusters.h"
#include "segmentation/plane.h"

namespace vantage::learning {

struct LearnerParams {
  segmentation::PlaneParams plane;
  segmentation::ClusterParams clusters;
  recognition::RecogniserParams recogniser;
  // New views:
  double new_view_confidence = 0.6;    // A new view is added when c falls below; (0, 1).
  double min_track_probability = 0.7;  // ...but only with p(o|c) at least this; (0, 1).
  int min_view_points = 20;            // A view needs so many interest points with depth; >= 4.
  double min_view_angle_deg = 10.0;    // A new view differs from every other by so much in direction, or by a third of an octave in
                                       // distance; the lower c, the less, down to half of it; >= 0.
  double max_spread_m = 0.003;         // ...and a pose that is held this well (object's origin, worst direction); > 0...
  double max_spread_deg = 0.35;        // ...and its axes; > 0...
  int min_links = 15;                  // ...by so many interest points; >= 3...
  double min_likeness = 0.9;           // ...at which the object looks as its views do (correlation of brightness, where there is
                                       // texture to compare); or a pose that agrees with the mount's; [-1, 1].
  // Tracking:
  int neighbour_views = 2;          // Tried beside the reference view when the object is not found against it; >= 0.
  double roi_margin = 0.25;         // Interest points are sought this share of the object's size around where it was; >= 0...
  double min_roi_margin_px = 10.0;  // ...or this far (and thrice the last error) around where its motion leads; >= 0.
  int surface_samples = 1000;       // Points of the learned surface that are drawn to the depth image; 0 = none.
  int texture_samples = 600;        // Likewise of its texture, drawn to the colour image; 0 = none.
  int surface_views = 3;            // Both are taken from so many nearest views; >= 1.
  double agreement_prior = 0.9;     // p(o) of a pose found without the mount (or the last frames) that agrees with it; [1/2, 1).
  double min_surface_agreement = 0.85;  // Where the last frames lead, and this share of the surface is measured in its place, the
                                        // object is held without interest points; (0, 1]...
  double surface_prior = 0.99;          // ...and p(o) is this; [1/2, 1)...
  double max_plain_spread_deg = 0.8;    // ...and a new view wants its axes held this well; > 0...
  double min_plain_confidence = 0.15;  // ...and this share seen of the learned points that ought to be, if there are any: a blurred
                                       // picture is no plain side; [0, 1).
  // Refinement, beside tracking:
  bool refine = true;            // Loops closed, views and points adjusted, the model tidied up.
  int refine_delay_frames = 15;  // It takes effect so many frames after it began; >= 1.
  int refined_views = 6;         // The newest so many are adjusted where no loop was closed; >= 1.
  RefinementParams refinement;
  LoopClosureParams loop_closure;
  UpkeepParams upkeep;
  // Losing and finding again:
  double sure_probability = 0.9;  // An object found again with p(o|c) at least this is tracked at once; (0, 1).
  int confirm_frames = 3;         // ...with less only after so many more frames; nothing is learned meanwhile; >= 0.
  int moved_frames = 5;           // An object seen gone from its place and found in one other place so often was moved; >= 1.
  // Where the mount's pose is known:
  bool require_mount_agreement = true;    // A track that contradicts it by more than this is not trusted.
  double max_mount_translation_m = 0.03;  // > 0.
  double max_mount_rotation_deg = 6.0;    // > 0.
  double mount_sigma_m = 0.003;           // How well it knows where the camera is: a pose that agrees is drawn to it; > 0.
  double mount_sigma_deg = 0.3;           // > 0.

  void Check() const;  // Throws std::invalid_argument naming the field.
};

}  // namespace vantage::learning
