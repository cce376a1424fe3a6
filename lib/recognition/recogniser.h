// Finds every known object in a frame, with pose, confidence and p(o|c) (section IV).
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "model/confidence.h"
#include "model/object_model.h"
#include "pose/ransac.h"
#include "recognition/matching.h"
#include "recognition/verification.h"

namespace vantage::recognition {

struct RecogniserParams {
  features::FeatureParams features;
  model::ConfidenceParams confidence;
  MatchingParams matching;
  double vote_bandwidth = 0.5;  // Of the mean shift, in radii of the object; > 0.
  int max_clusters = 6;         // Vote clusters (heaviest first) that get a pose hypothesis; >= 1.
  pose::RansacParams ransac;
  int min_inliers = 7;                // Fewer supporting matches are no hypothesis; >= 4.
  double guided_radius_px = 8.0;      // Second round: model points look for their feature this near their projection; > 0.
  double guided_max_distance = 0.65;  // ...with a descriptor at least this similar; (0, 2].
  VerificationParams verification;
  bool use_query_depth = true;   // Poses the depth image contradicts are rejected; refinement uses depth.
  double min_probability = 0.0;  // Detections with a lower p(o|c) are not reported; [0, 1].
  std::uint32_t seed = 0;

  void Check() const;               // Throws std::invalid_argument naming the field.
  std::string Fingerprint() const;  // What a fitted measure holds for.
};

// Why the object's own measures do not hold for these parameters; empty where they do or where it has none.
std::string MeasuresMismatch(const model::ObjectModel& object, const RecogniserParams& params);

struct Detection {
  std::string object;
  geometry::Rigid T_camera_object = geometry::Rigid::Identity();
  model::Confidence confidence;  // (2)
  double probability = 0.0;      // p(o|c), by the object's measure.
  measures::Source source = measures::Source::kDefault;
  int inliers = 0;
  std::vector<Eigen::Vector2d> inlier_pixels;
};

// Where the time of one frame went, seconds.
struct StageTimes {
  double match_s = 0.0;   // Quantising, ranking objects, tentative matches.
  double vote_s = 0.0;    // (7) and mean shift.
  double pose_s = 0.0;    // (8).
  double verify_s = 0.0;  // Guided matching, refinement, depth, conflicts, confidence.
};

// The frame's features are computed once by the caller, who may share them between recogniser, learner and trials.
class Recogniser {
 public:
  explicit Recogniser(const RecogniserParams& params);
  ~Recogniser();
  Recogniser(Recogniser&&) noexcept;
  Recogniser& operator=(Recogniser&&) noexcept;

  const RecogniserParams& params() const { return params_; }

  // Adds the object or replaces what was known of it. Where its own measures are missing or of other settings, p(o|c) is that of
  // the other objects pooled, or else the shipped default. Cost: linear in its descriptors.
  // Throws std::invalid_argument where its features are of another kind than ours.
  void Set(std::shared_ptr<const model::ObjectModel> object);
  void Remove(const std::string& name);
  int size() const;

  // p(o|c) of an object without measures of its own.
  const measures::ObservedSuccess& Pooled() const;

  features::Features Extract(const rgbd::Frame& frame) const;

  // Detections by falling probability (equal: more inliers first); at most verification.max_instances per object. `priors`: p(o) by
  // object name, 1/2 where not given. `times` may be null.
  std::vector<Detection> Recognise(const rgbd::Frame& frame, const features::Features& features,
                                   const std::vector<std::pair<std::string, double>>& priors = {},
                                   StageTimes* times = nullptr) const;

 private:
  struct Impl;
  RecogniserParams params_;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vantage::recognition
