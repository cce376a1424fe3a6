// Holds camera poses against what a recording's own pictures say: where recorded poses and tracked ones disagree, which are off?
#pragma once

#include <string>
#include <vector>

#include "learning/learner.h"
#include "vantage/verb.h"

namespace vantage::cli {

// One frame and two opinions of where it was taken, each in coordinates that stand still of its own.
struct WitnessedFrame {
  rgbd::Frame frame;
  geometry::Rigid T_camera_recorded = geometry::Rigid::Identity();
  geometry::Rigid T_camera_object = geometry::Rigid::Identity();
};

// The witness is a bundle adjustment of all that the whole images show, the object and everything about it: interest points matched
// over 1 to 34 frames, their pixels and measured depths. It knows neither opinion (it starts from a chain of matched frames). All
// are compared by where they put a camera seen from the first frame's; adjusted twice more with either half of the points, the
// witness says how far it is to be trusted itself.
// {"points", "rms_px", "own", "recorded", "tracked", "each_other"}, errors as ErrorFigures; null where the pictures do not hang
// together. Cost: about half a second a frame.
Json WitnessFigures(const std::vector<WitnessedFrame>& frames, const learning::LearnerParams& params);

// The figures for people.
std::string WitnessSummary(const Json& figures);

}  // namespace vantage::cli
