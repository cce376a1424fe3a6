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

// Judges the detections of one stored object that was learned from a frame of the same recording: that frame's truth ties the
// model's coordinates to the mesh's.
class TruthJudge {
 public:
  // Throws std::runtime_error where the recording has no truth for the object in the frame it was first learned from.
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
