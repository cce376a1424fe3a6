// The learner on a recording, held against the recording's own poses.
#pragma once

#include <string>

#include "learning/learner.h"
#include "vantage/verb.h"

namespace vantage::cli {

struct SequenceTrialOptions {
  std::string folder;
  int object_id = 0;           // Of scene_gt.json; 0 = the one nearest to the image centre, judged by the camera's poses.
  std::string frames = "all";  // As rgbd::SelectFrames.
  int passes = 1;
  std::string find;             // Frames in which the recogniser finds it afterwards; empty = none.
  bool witness = false;         // The recorded camera poses are held against a bundle adjustment of the whole images.
  bool no_query_depth = false;  // Poses are found in colour only. Where depth was rendered at the true poses it would tell them.
};

// The learner is shown neither the camera's nor the object's poses. Tables and a plot go to `save` where it is not empty. Throws
// std::runtime_error where the recording cannot be read, or neither poses nor truth are known.
Json TrySequence(const SequenceTrialOptions& options, learning::LearnerParams params, const std::string& save);

}  // namespace vantage::cli
