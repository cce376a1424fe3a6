// Holds camera poses against what a recording's own pictures show beside the object: where a recorded pose and a tracked one
// disagree, which of the two is off?
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

// The witness is the camera's motion between frames `gap` apart in the list as the background shows it (the outline of
// `points_in_object`, widened, is left out): interest points start it, then one frame's surface and texture are fitted to the
// other's images, which knows neither opinion. Fitted there and back it says how far it is to be trusted itself: "own".
// {"gap", "pairs", "own", "recorded", "tracked", "each_other"}, errors as ErrorFigures. Cost: about a second a frame.
Json WitnessFigures(const std::vector<WitnessedFrame>& frames, const Eigen::Matrix3Xd& points_in_object,
                    const learning::LearnerParams& params, int gap);

// The figures for people.
std::string WitnessSummary(const Json& figures);

}  // namespace vantage::cli
