// The online learner (section III): finds an object on the table, tracks it, adds keyframes, and never learns on a lost track.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "learning/params.h"
#include "pose/refine.h"

namespace vantage::learning {

enum class State {
  kSearching,     // There is no model yet: a cluster to begin with is sought.
  kTracking,      // Surely on the object. Only here is anything learned.
  kLost,          // Not found in the last frame; recognition seeks it in the whole image.
  kRelocalising,  // Found again, not yet surely: the following frames have to confirm it.
};
std::string ToString(State state);

// What one frame came to.
struct LearnerResult {
  State state = State::kSearching;
  std::optional<geometry::Rigid> T_camera_object;  // Where the object is tracked.
  model::Confidence confidence;
  double probability = 0.0;  // p(o|c).
  int reference_view = -1;   // Index of the tracked view.
  int inliers = 0;
  pose::PoseSpread spread;         // As of Track.
  std::optional<double> likeness;  // As of Track.
  bool view_added = false;
  bool refined = false;  // A refinement took effect in this frame: points and poses of the model have moved.
  std::string note;      // Why nothing was learned, in a few words; empty where there is nothing to say.
};

// Where to start: the cluster that holds this pixel; without it, the one nearest to the image centre.
struct Target {
  std::optional<Eigen::Vector2d> pixel;
};

class Learner {
 public:
  // `name`: of a new object. `known`: go on with this model (it is lost at first, and sought by recognition).
  Learner(const LearnerParams& params, const std::string& name, std::shared_ptr<const model::ObjectModel> known = nullptr);
  ~Learner();
  Learner(Learner&&) noexcept;
  Learner& operator=(Learner&&) noexcept;

  // One frame. Where the frame's T_world_camera is known it is used as a check (never needed). `known_pose`: place the object by
  // this T_camera_object instead of tracking.
  LearnerResult Process(const rgbd::Frame& frame, const Target& target = {},
                        const std::optional<geometry::Rigid>& known_pose = std::nullopt);

  // Objects met before. Where the one to begin with turns out to be one of them its model is continued, under its name, instead of
  // a twin. Throws as recognition::Recogniser::Set.
  void SetOthers(const std::vector<std::shared_ptr<const model::ObjectModel>>& others);

  const std::string& name() const;
  // The model so far; null before the first view. A new object is made for every change: what was handed out stays as it was.
  std::shared_ptr<const model::ObjectModel> object() const;
  // Waits for the refinement of every view so far and lets it take effect now, at the end of a run. Whether anything has changed.
  bool FinishRefinement();
  // The measures p(o|c) is judged by from now on.
  void SetMeasures(const measures::Measures& measures);

  // Table plane and clusters of the last frame that was segmented (camera coordinates of that frame).
  const std::optional<segmentation::Plane>& plane() const;
  const std::vector<segmentation::Cluster>& clusters() const;
  // Where the object stands in the world: known once it was tracked in a frame with a known camera pose.
  std::optional<geometry::Rigid> T_world_object() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vantage::learning
