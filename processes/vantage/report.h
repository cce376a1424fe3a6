// What virtual trials and, where there is truth, photographs say of the measures: the paper's figures 6 to 13 and what it saw in
// them.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "assessment/assessor.h"
#include "assessment/held_out.h"
#include "vantage/verb.h"

namespace vantage::cli {

// One object's virtual trials; levels of noise and blur all equally frequent.
struct ReportObject {
  std::string name;
  int views = 0;
  std::vector<assessment::Trial> trials;
  measures::Measures measures;  // Fitted on them.
};

// Photographs of one of the objects with truth, from which nothing was learned.
struct ReportTruth {
  std::string object;
  std::string sequence;
  std::vector<assessment::HeldOutFrame> frames;
  std::vector<assessment::HeldOutHypothesis> hypotheses;  // Of the whole model.
  std::vector<assessment::ViewTrial> view_trials;         // Of its views alone.
};

struct Report {
  std::vector<ReportObject> objects;
  std::optional<ReportTruth> truth;
  recognition::RecogniserParams recogniser;
  measures::ObservedFit observed_fit = measures::ObservedFit::kLogistic;
};

// Something the paper saw, and whether we see it.
struct Observation {
  std::string object;  // Empty where it is about all of them.
  std::string claim;
  std::string seen;
  bool agrees = false;
  std::string why;  // What bears on it, as measured in the trials where it can be.
};
std::vector<Observation> Observe(const Report& report);

// DIR/index.html with plots (where gnuplot is found; the data they are made of stay beside them) and observations, and
// DIR/report.json. Throws std::runtime_error where DIR cannot be written.
void SaveReport(const Report& report, const std::vector<Observation>& observations, const std::string& folder);

Json ToJson(const std::vector<Observation>& observations);

// Of the trials that show the object, ascending; at least one.
std::vector<double> NoiseLevels(const std::vector<assessment::Trial>& trials);

// The measures again with only some of the trials, or by another distance for what counts as right.
measures::Measures FitWhere(const Report& report, const std::vector<assessment::Trial>& trials,
                            const std::function<bool(const assessment::Trial&)>& taken);
measures::Measures FitAt(const Report& report, std::vector<assessment::Trial> trials, double correct_m);
// As photographs say: p(o|c) from all hypotheses, p(o|theta) by that from views alone.
measures::Measures FitTruth(const ReportTruth& truth);

// Mean pose error of the most likely proposals of views alone over rotation, one value for every 5 degrees that has any.
struct ErrorBin {
  double rotation_deg = 0.0;  // Middle.
  int count = 0;
  double mean_m = 0.0, median_m = 0.0;
  Eigen::Vector3d by_axis_m = Eigen::Vector3d::Zero();  // Of photographs only.
};
std::vector<ErrorBin> ErrorOverRotation(const ReportObject& object);
std::vector<ErrorBin> ErrorOverRotation(const ReportTruth& truth);
// Where a mean (or median) error passes a distance, degrees; nullopt where it does not.
std::optional<double> PassesAt(const std::vector<ErrorBin>& bins, double error_m, double ErrorBin::*error = &ErrorBin::mean_m);

}  // namespace vantage::cli
