// Holds detections against a recording's truth.
#pragma once

#include "recognition/recogniser.h"
#include "rgbd/bop.h"

namespace vantage::cli {

struct Tally {
  int frames = 0;      // In which at least half of the object's points lie in the image.
  int right = 0;       // ...with a detection (p(o|c) >= 1/2) less than 40 mm from the truth (mean point distance).
  int right_10mm = 0;  // ...less than 10 mm.
  int detections = 0;  // With p(o|c) >= 1/2, in all frames.
  int wrong = 0;       // Of those, 40 mm or more from the truth.
};

// The store's object. Throws std::runtime_error where it holds none or several.
model::ObjectModel OnlyObjectOf(const std::string& store);

// T_mesh_object of a model learned from this recording: the truth of the frame it was first learned from ties its coordinates to
// the mesh's. Throws std::runtime_error where the recording has no truth for the object there.
geometry::Rigid MeshFromObject(const rgbd::BopScene& scene, int object_id, const model::ObjectModel& object);

// Judges the detections of one stored object that was learned from the same recording.
class TruthJudge {
 public:
  // Throws as MeshFromObject.
  TruthJudge(const rgbd::BopScene& scene, int object_id, const model::ObjectModel& object);

  void Add(const rgbd::Frame& frame, const std::vector<recognition::Detection>& detections);
  const Tally& tally() const { return tally_; }

 private:
  const rgbd::BopScene& scene_;
  int object_id_;
  std::string name_;
  Eigen::Matrix3Xd points_;  // Object frame.
  geometry::Rigid T_mesh_object_;
  Tally tally_;
};

}  // namespace vantage::cli
