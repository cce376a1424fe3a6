// Measures learned from virtual views, held against frames of the same recording that nothing was learned from.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "assessment/assessor.h"
#include "assessment/held_out.h"
#include "common/params.h"
#include "simulation/simulated_world.h"
#include "vantage/verb.h"

namespace vantage::cli {

struct CalibrationOptions {
  std::string folder;  // A recording...
  int object_id = 0;
  std::optional<simulation::WorldParams> world;  // ...or the first object of a simulated world...
  double turned_deg = 0.0;                       // ...which is turned by so much before it judges.
  std::string store;                             // Judges its one object's stored measures; empty = models are drawn.
  std::vector<int> views = {2, 4, 8, 16};
  int draws = 10;                   // Models for each number of views.
  int max_trials = 160;             // Virtual images with the object, of one model.
  std::vector<std::string> absent;  // Recordings that do not show the object.
  int absent_step = 1;              // Every so manieth of their frames.
  bool tune = false;                // Judge on even ids that are not learned from: odd ones are not looked at.
  std::uint32_t seed = 0;
};

// A model, what its measures say, and what came of it.
struct JudgedModel {
  int views = 0;
  int draw = 0;
  measures::Measures measures;
  std::vector<assessment::Trial> trials;                  // Virtual; none where the measures were stored.
  std::vector<assessment::HeldOutHypothesis> hypotheses;  // By frame.
  std::vector<assessment::ViewTrial> view_trials;         // Its views, each offered alone.
  std::vector<measures::JointSample> looks;               // Frames in which it should be detected.

  double DetectionRate() const;
  double Completeness(measures::CompletenessRule rule) const;  // Predicted for the directions and distances of these frames.
};

struct CalibrationTrial {
  int taught = 0;                                // Frames to learn from that show enough of the object...
  int offered = 0;                               // ...of so many.
  std::vector<assessment::HeldOutFrame> frames;  // Those of the recording, then those without the object.
  std::vector<JudgedModel> models;
};

// Views are learned at true poses from even ids; odd ids judge, found in colour alone. Numbers of views that the object cannot be
// learned with are left out: a plain one may have no model at all. `progress` is called from any thread, one at a time. Throws
// std::runtime_error where a recording or the store lacks what is needed, or the store's measures are of other settings.
CalibrationTrial TryCalibration(const CalibrationOptions& options, const params::LibraryParams& params,
                                const std::function<void(int done, int of)>& progress = {});

// Per number of views and pooled: class balance, Brier score, calibration error with its interval, 50 % crossings, completeness.
Json FiguresOf(const CalibrationTrial& trial, std::uint32_t seed);

// The figures as a table for people.
std::string TableOf(const Json& figures);

// Tables of hypotheses, of views offered alone, of virtual trials and of models, the figures, and, where the program gnuplot is
// found, DIR/reliability.png. Throws std::runtime_error where DIR cannot be written.
void SaveCalibration(const CalibrationTrial& trial, const Json& figures, const std::string& folder);

}  // namespace vantage::cli
