// Learns an object's measures from virtual views of its (partial) model (section VI): no ground truth needed.
#pragma once

#include <cstdint>
#include <functional>
#include <opencv2/core.hpp>
#include <vector>

#include "assessment/background.h"
#include "measures/completeness.h"
#include "model/object_model.h"
#include "recognition/recogniser.h"

namespace vantage::assessment {

struct TrialParams {
  int trials_per_view = 40;         // Virtual images per learned view, each offering only that view; >= 1.
  int negatives_per_view = 12;      // Images without the object, each another background as long as there are; >= 0.
  double max_rotation_deg = 85.0;   // Out of plane, uniform in 0..max; (0, 90].
  double min_elevation_deg = 10.0;  // No camera is lower (object z up): below is the table; [-90, 90).
  double max_scale_octaves = 1.0;   // Distances +-max about the views' median, mostly near it: 1 = 0.5..2 times; >= 0.
  double max_image_noise = 16.0;    // Sigma, grey levels: 8 even levels from 0; >= 0.
  double max_blur_px = 1.6;         // Sigma, likewise; >= 0.
  double level_ratio = 0.25;        // Every level is so much rarer than the one below; (0, 1], 1 = all alike.
  double max_brightness = 0.25;     // Relative change of brightness, and of gamma; [0, 1).
  double lamp_share = 0.0;          // So much of the light is from a lamp: on an object met again, from another side; [0, 1).
  double max_occlusion = 0.0;       // Something hides up to this share of the object's box; [0, 1).
  double correct_m = 0.04;          // Mean point distance below which a detection is right; > 0.
  int image_width = 320;            // Virtual images are crops around the object, as tight as they can be but
  int image_height = 240;           // never larger than twice this, close objects included; >= 64.
  measures::ObservedFit observed_fit = measures::ObservedFit::kLogistic;  // How p(o|c) is made of the confidences.
  std::uint32_t seed = 0;

  void Check() const;
};

// A pose the recogniser proposed.
struct Proposal {
  double confidence = 0.0;  // (2)
  bool correct = false;     // Within correct_m of the truth.
  double error_m = 0.0;     // Mean point distance from the truth; infinite where the object is not there.
};

// From where a view is tried.
struct Displacement {
  double rotation_rad = 0.0;  // Out of plane.
  double log2_scale = 0.0;    // log2(learned distance / seen distance).
};

// One virtual image and what the recogniser made of it.
struct Trial {
  int view = 0;              // Index of the view offered.
  bool object_shown = true;  // false: a negative, no object in the image.
  double rotation_rad = 0.0;
  double log2_scale = 0.0;
  double image_noise = 0.0;
  double blur_px = 0.0;
  std::vector<Proposal> alone;       // Of the view alone, the most likely first; none in a negative.
  std::vector<Proposal> together;    // Likewise with all views up to this one on offer.
  std::vector<Displacement> others;  // Of the views on offer then besides this one; those less than 90 degrees off.

  // What the view alone led to.
  bool hypothesis() const { return !alone.empty(); }
  bool correct() const { return hypothesis() && alone.front().correct; }
  double confidence() const { return hypothesis() ? alone.front().confidence : 0.0; }
};

// A share of the trials: those whose number leaves `index` when divided by `of`.
struct Part {
  int index = 0;  // In [0, of).
  int of = 1;     // >= 1.
};

// Trials for the views from `first_view` on. `backgrounds`: images the object is pasted over (the run's own frames with the objects
// masked, or photographs); plain grey noise where empty; their features are found where they have none yet. Only as strong interest
// points count as the first background would have kept. Negatives are whole backgrounds, each once: it is whole models and whole
// images that make wrong detections. Deterministic in (model, params, backgrounds); a view's dice do not depend on first_view, but
// views learned later change what earlier ones look like from aside. `progress` is called after every trial; what it throws comes
// out. Throws std::invalid_argument for params, a part or a first_view out of range and backgrounds that are not CV_8UC3. Cost:
// about 90 ms of one core a trial, two thirds of it interest points.
std::vector<Trial> RunTrials(const model::ObjectModel& object, int first_view, std::vector<Background>* backgrounds,
                             const recognition::RecogniserParams& recogniser, const TrialParams& params,
                             const std::function<void(int done, int of)>& progress = {}, const Part& part = {});

// Both measures from trials: p(o|c) from what was proposed with all views on offer, as the model is used; p(o|theta) from views
// alone, and from views together how far they fail together. A view counts as detected where its most likely proposal is right and
// has p(o|c) >= 1/2. By default p(o|c) is logistic: in photographs it holds better than the paper's two Gaussians (vantage evaluate
// calibration tells of each).
measures::Measures FitMeasures(const std::vector<Trial>& trials, const recognition::RecogniserParams& recogniser,
                               measures::ObservedFit observed_fit = measures::ObservedFit::kLogistic);

// The first of them alone.
measures::ObservedSuccess FitObserved(const std::vector<Trial>& trials, measures::ObservedFit fit);

// Of the viewpoints' distances, the upper of two middle ones, metres; 1 without viewpoints.
double MedianDistance(const std::vector<measures::Viewpoint>& viewpoints);

// Uniform p(theta) over the part of the view sphere between two elevations (radians, object z up) at the given distances.
std::vector<measures::WeightedViewpoint> UniformViewpoints(double min_elevation_rad, double max_elevation_rad,
                                                           const std::vector<double>& distances_m, int directions = 200);

}  // namespace vantage::assessment
