// The online learner (section III): finds an object on the table, tracks it, adds keyframes, and never learns on a lost track.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "recognition/recogniser.h"
#include "segmentation/clusters.h"
#include "segmentation/plane.h"

namespace vantage::learning {

struct LearnerParams {
  segmentation::PlaneParams plane;
  segmentation::ClusterParams clusters;
  recognition::RecogniserParams recogniser;
  double new_view_confidence = 0.6;    // A new view is added when c falls below; (0, 1).
  double min_track_probability = 0.7;  // ...but only with p(o|c) at least this; (0, 1).
  int min_view_points = 20;            // A view needs so many interest points with depth; >= 4.
  double min_view_angle_deg =
      10.0;  // A new view differs from every other by so much in direction (or by a third of an octave in distance); >= 0.
  // Where the mount's pose is known:
  bool require_mount_agreement = true;    // A track that contradicts it by more than this is not trusted.
  double max_mount_translation_m = 0.03;  // > 0.
  double max_mount_rotation_deg = 6.0;    // > 0.
  double mount_sigma_m = 0.003;           // How well it knows where the camera is: a pose that agrees is drawn to it; > 0.
  double mount_sigma_deg = 0.3;           // > 0.
  double agreement_prior = 0.9;           // p(o) of a pose found without it that agrees with it; [1/2, 1).
  int surface_samples = 1000;             // Points of the learned surface that are drawn to the depth image; 0 = none.
  int surface_views = 3;                  // ...taken from so many nearest views; >= 1.
  double roi_margin = 0.25;  // Interest points are sought this share of the object's size around where it is expected; >= 0.

  void Check() const;  // Throws std::invalid_argument naming the field.
};

enum class State { kSearching, kTracking, kLost, kRelocalising };
std::string ToString(State state);

// What one frame came to.
struct LearnerResult {
  State state = State::kSearching;
  std::optional<geometry::Rigid> T_camera_object;  // Where the object is tracked.
  model::Confidence confidence;
  double probability = 0.0;  // p(o|c).
  int reference_view = -1;   // Index of the tracked view.
  int inliers = 0;
  bool view_added = false;
  std::string note;  // Why nothing was learned, in a few words; empty where there is nothing to say.
};

// Where to start: the cluster that holds this pixel; without it, the one nearest to the image centre.
struct Target {
  std::optional<Eigen::Vector2d> pixel;
};

class Learner {
 public:
  // `name`: of a new object. `known`: go on with this model (it starts by relocalising).
  Learner(const LearnerParams& params, const std::string& name, std::shared_ptr<const model::ObjectModel> known = nullptr);
  ~Learner();
  Learner(Learner&&) noexcept;
  Learner& operator=(Learner&&) noexcept;

  // One frame. Where the frame's T_world_camera is known it is used as a check (never needed). `known_pose`: place the object by
  // this T_camera_object instead of tracking.
  LearnerResult Process(const rgbd::Frame& frame, const Target& target = {},
                        const std::optional<geometry::Rigid>& known_pose = std::nullopt);

  // The model so far; null before the first view. A new object is made for every change: what was handed out stays as it was.
  std::shared_ptr<const model::ObjectModel> object() const;
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
