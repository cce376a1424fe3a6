// Measures held against frames with truth from which nothing was learned.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "model/object_model.h"
#include "recognition/recogniser.h"

namespace vantage::assessment {

struct HeldOutFrame {
  rgbd::Frame frame;  // Without depth, should that have been rendered at the true pose.
  features::Features features;
  std::optional<geometry::Rigid> T_camera_mesh;  // True pose; nullopt where the object is not there.
  bool counts = false;                           // Enough of the object is in the image: it should be detected.
};

// What hypotheses are held against.
struct Truth {
  Eigen::Matrix3Xd points_in_mesh;  // The true surface, metres.
  geometry::Rigid T_mesh_object = geometry::Rigid::Identity();
  double correct_m = 0.04;  // Mean point distance below which a hypothesis is right.

  bool IsRight(const geometry::Rigid& T_camera_object, const HeldOutFrame& frame) const;
  // How far the surface's points are off along x, y and z of the camera, mean of absolute values, metres. Throws std::logic_error
  // where the object is not in the frame.
  Eigen::Vector3d ErrorByAxis(const geometry::Rigid& T_camera_object, const HeldOutFrame& frame) const;
};

// A pose the recogniser proposed, however unlikely.
struct HeldOutHypothesis {
  int frame = 0;  // Index.
  double confidence = 0.0;
  bool right = false;
};

// One frame and what a single learned view, offered alone, made of it.
struct ViewTrial {
  int view = 0;   // Index.
  int frame = 0;  // Index.
  double rotation_rad = 0.0;
  double log2_scale = 0.0;
  bool hypothesis = false;  // There is one. Of the most likely:
  bool right = false;
  double confidence = 0.0;
  double error_m = 0.0;                                       // Mean point distance from the truth.
  Eigen::Vector3d error_by_axis_m = Eigen::Vector3d::Zero();  // As Truth::ErrorByAxis().
};

// Every hypothesis about the object in every frame, by frame, the most likely first. Cost: the recogniser's, once a frame, without
// extraction; all cores.
std::vector<HeldOutHypothesis> Hypotheses(const std::shared_ptr<const model::ObjectModel>& object, const Truth& truth,
                                          const std::vector<HeldOutFrame>& frames, const recognition::RecogniserParams& recogniser);

// Every view with every frame that counts and lies less than 90 degrees from it, by view. All cores.
std::vector<ViewTrial> TryViewsAlone(const model::ObjectModel& object, const Truth& truth, const std::vector<HeldOutFrame>& frames,
                                     const recognition::RecogniserParams& recogniser);

// The measures that such frames say are true: p(o|c) from hypotheses, p(o|theta) from views alone, detected by that p(o|c).
bool IsDetected(const ViewTrial& trial, const measures::ObservedSuccess& observed);  // Right, and p(o|c) >= 1/2.
measures::ObservedSuccess FitObserved(const std::vector<HeldOutHypothesis>& hypotheses);
measures::PredictedSuccess FitPredicted(const std::vector<ViewTrial>& trials, const measures::ObservedSuccess& observed);

// Every frame that counts: what the object's views together predict for it by the object's measures, and whether its most likely
// hypothesis is right and has p(o|c) >= 1/2.
std::vector<measures::JointSample> Looks(const model::ObjectModel& object, const std::vector<HeldOutHypothesis>& hypotheses,
                                         const std::vector<HeldOutFrame>& frames, const Truth& truth);

}  // namespace vantage::assessment
