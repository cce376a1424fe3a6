// The figures of a calibration trial, its tables and its plots.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <sstream>

#include "measures/calibration.h"
#include "vantage/calibration_trial.h"

namespace vantage::cli {
namespace {

namespace fs = std::filesystem;

constexpr int kBins = 15;
constexpr double kDegree = M_PI / 180.0;

using Models = std::vector<const JudgedModel*>;
using ByFrame = std::map<int, std::vector<measures::Forecast>>;

double CalibrationErrorOfBins(const std::vector<measures::Forecast>& forecasts) {
  return measures::CalibrationError(forecasts, kBins);
}

// Of what is forecast frame by frame.
Json ForecastFigures(const ByFrame& by_frame, std::uint32_t seed) {
  std::vector<std::vector<measures::Forecast>> groups;
  std::vector<measures::Forecast> all;
  for (const auto& [frame, forecasts] : by_frame) {
    groups.push_back(forecasts);
    all.insert(all.end(), forecasts.begin(), forecasts.end());
  }
  const measures::Interval interval = measures::BootstrapInterval(groups, CalibrationErrorOfBins, 1000, 0.95, seed);
  Json figures;
  figures["count"] = all.size();
  figures["right"] = std::count_if(all.begin(), all.end(), [](const measures::Forecast& forecast) { return forecast.outcome; });
  figures["brier_score"] = measures::BrierScore(all);
  figures["calibration_error"] = CalibrationErrorOfBins(all);
  figures["calibration_error_95"] = {interval.lower, interval.upper};
  figures["reliability"] = Json::array();
  for (const measures::ReliabilityBin& bin : measures::Reliability(all, kBins)) {
    figures["reliability"].push_back({{"probability", bin.mean_probability}, {"frequency", bin.frequency}, {"count", bin.count}});
  }
  return figures;
}

// Share of the hypotheses that are right, kept off 0 and 1.
double PriorOf(const Models& models) {
  double right = 0.5, of = 1.0;
  for (const JudgedModel* model : models) {
    for (const auto& hypothesis : model->hypotheses) right += hypothesis.right;
    of += static_cast<double>(model->hypotheses.size());
  }
  return right / of;
}

// p(o|c) of every hypothesis by the model's own measure, or by what `observed` makes of the model.
template <typename Observed>
ByFrame ObservedForecasts(const Models& models, double prior, const Observed& observed) {
  ByFrame by_frame;
  for (const JudgedModel* model : models) {
    const measures::ObservedSuccess by = observed(*model);
    for (const auto& hypothesis : model->hypotheses) {
      by_frame[hypothesis.frame].push_back({by.Probability(hypothesis.confidence, prior), hypothesis.right});
    }
  }
  return by_frame;
}

measures::ObservedSuccess OwnObserved(const JudgedModel& model) { return model.measures.observed; }

// What the other fits would have made of the same virtual trials.
Json FiguresOfFits(const Models& models, double prior, std::uint32_t seed) {
  Json figures;
  for (const measures::ObservedFit fit : measures::kObservedFits) {
    const auto fitted = [fit](const JudgedModel& model) { return assessment::FitObserved(model.trials, fit); };
    figures[measures::ToString(fit)] = ForecastFigures(ObservedForecasts(models, prior, fitted), seed);
  }
  return figures;
}

bool IsDetected(const JudgedModel& model, const assessment::ViewTrial& trial) {
  return assessment::IsDetected(trial, model.measures.observed);
}

double Predicted(const JudgedModel& model, const assessment::ViewTrial& trial) {
  return model.measures.predicted.Probability(trial.rotation_rad, trial.log2_scale);
}

ByFrame PredictedForecasts(const Models& models) {
  ByFrame by_frame;
  for (const JudgedModel* model : models) {
    for (const auto& trial : model->view_trials) {
      by_frame[trial.frame].push_back({Predicted(*model, trial), IsDetected(*model, trial)});
    }
  }
  return by_frame;
}

// What the held-out frames say p(o|theta) is, by the same fit.
measures::PredictedSuccess RealCurve(const Models& models) {
  std::vector<measures::PredictionSample> samples;
  for (const JudgedModel* model : models) {
    for (const auto& trial : model->view_trials)
      samples.push_back({trial.rotation_rad, trial.log2_scale, IsDetected(*model, trial)});
  }
  return measures::PredictedSuccess::Fit(samples, measures::Source::kOwn);
}

template <typename Value>
double Mean(const Models& models, const Value& value) {
  double sum = 0.0;
  for (const JudgedModel* model : models) sum += value(*model);
  return sum / static_cast<double>(models.size());
}

Json CrossingFigures(const Models& models) {
  const double learned =
      Mean(models, [](const JudgedModel& model) { return model.measures.predicted.HalfwayRotation(); }) / kDegree;
  const double real = RealCurve(models).HalfwayRotation() / kDegree;
  return {{"virtual_deg", learned}, {"real_deg", real}, {"difference_deg", learned - real}};
}

// By how much every look of every model was expected rather more than found; all models are judged on the same frames.
std::vector<std::vector<double>> LookErrors(const Models& models, measures::CompletenessRule rule) {
  std::vector<std::vector<double>> errors;
  for (const JudgedModel* model : models) {
    errors.emplace_back();
    for (const auto& look : model->looks) {
      errors.back().push_back(look.predicted.Value(rule, model->measures.predicted.common_cause()) - (look.detected ? 1.0 : 0.0));
    }
  }
  return errors;
}

Json CompletenessFigures(const Models& models, std::uint32_t seed) {
  Json figures;
  figures["detection_rate"] = Mean(models, [](const JudgedModel& model) { return model.DetectionRate(); });
  for (const measures::CompletenessRule rule : measures::kCompletenessRules) {
    const auto difference = [rule](const JudgedModel& model) { return model.Completeness(rule) - model.DetectionRate(); };
    const double mean = Mean(models, difference);
    const double variance = Mean(models, [&](const JudgedModel& model) { return std::pow(difference(model) - mean, 2); });
    const measures::Interval interval = measures::BootstrapMeanInterval(LookErrors(models, rule), 1000, 0.95, seed);
    std::vector<measures::Forecast> forecasts;
    for (const JudgedModel* model : models) {
      const double share = model->measures.predicted.common_cause();
      for (const auto& look : model->looks) forecasts.push_back({look.predicted.Value(rule, share), look.detected});
    }
    figures[measures::ToString(rule)] = {
        {"predicted", Mean(models, [rule](const auto& model) { return model.Completeness(rule); })},
        {"difference", mean},
        {"difference_95", {interval.lower, interval.upper}},
        {"difference_sd", std::sqrt(variance)},
        {"brier_score", measures::BrierScore(forecasts)}};
  }
  return figures;
}

Json FiguresOfModels(const Models& models, double prior, std::uint32_t seed) {
  Json figures;
  figures["models"] = models.size();
  figures["observed"] = ForecastFigures(ObservedForecasts(models, prior, OwnObserved), seed);
  figures["observed_prior_half"] = ForecastFigures(ObservedForecasts(models, 0.5, OwnObserved), seed);
  figures["predicted"] = ForecastFigures(PredictedForecasts(models), seed);
  figures["crossing"] = CrossingFigures(models);
  figures["completeness"] = CompletenessFigures(models, seed);
  return figures;
}

std::string HypothesisTable(const CalibrationTrial& trial) {
  std::ostringstream text;
  text << "views,draw,frame,absent,confidence,probability,right\n";
  for (const JudgedModel& model : trial.models) {
    for (const auto& hypothesis : model.hypotheses) {
      const auto& frame = trial.frames[static_cast<std::size_t>(hypothesis.frame)];
      text << model.views << ',' << model.draw << ',' << hypothesis.frame << ',' << !frame.T_camera_mesh << ','
           << hypothesis.confidence << ',' << model.measures.observed.Probability(hypothesis.confidence) << ',' << hypothesis.right
           << '\n';
    }
  }
  return text.str();
}

std::string ViewTable(const CalibrationTrial& trial) {
  std::ostringstream text;
  text << "views,draw,view,frame,rotation_deg,log2_scale,predicted,right,confidence,detected\n";
  for (const JudgedModel& model : trial.models) {
    for (const auto& view : model.view_trials) {
      text << model.views << ',' << model.draw << ',' << view.view << ',' << view.frame << ',' << view.rotation_rad / kDegree << ','
           << view.log2_scale << ',' << Predicted(model, view) << ',' << view.right << ',' << view.confidence << ','
           << IsDetected(model, view) << '\n';
    }
  }
  return text.str();
}

std::string TrialTable(const CalibrationTrial& trial) {
  std::ostringstream text;
  text << "views,draw,view,shown,rotation_deg,log2_scale,noise,blur_px,proposals,confidence,right,together,together_confidence,"
          "together_right\n";
  for (const JudgedModel& model : trial.models) {
    for (const assessment::Trial& one : model.trials) {
      text << model.views << ',' << model.draw << ',' << one.view << ',' << one.object_shown << ',' << one.rotation_rad / kDegree
           << ',' << one.log2_scale << ',' << one.image_noise << ',' << one.blur_px << ',' << one.alone.size() << ','
           << one.confidence() << ',' << one.correct() << ',' << one.together.size() << ','
           << (one.together.empty() ? 0.0 : one.together.front().confidence) << ','
           << (!one.together.empty() && one.together.front().correct) << '\n';
    }
  }
  return text.str();
}

std::string ModelTable(const CalibrationTrial& trial) {
  std::ostringstream text;
  text << "views,draw,right_mean,right_sigma,wrong_mean,wrong_sigma,halfway_deg,common_cause,detection_rate";
  for (const auto rule : measures::kCompletenessRules) text << ',' << measures::ToString(rule);
  text << "\n";
  for (const JudgedModel& model : trial.models) {
    const measures::ObservedSuccess& observed = model.measures.observed;
    text << model.views << ',' << model.draw << ',' << observed.positive().mean << ',' << observed.positive().sigma << ','
         << observed.negative().mean << ',' << observed.negative().sigma << ','
         << model.measures.predicted.HalfwayRotation() / kDegree << ',' << model.measures.predicted.common_cause() << ','
         << model.DetectionRate();
    for (const auto rule : measures::kCompletenessRules) text << ',' << model.Completeness(rule);
    text << '\n';
  }
  return text.str();
}

// gnuplot data: probability, frequency, count.
std::string ReliabilityData(const std::string& name, const Json& figures) {
  std::ostringstream text;
  text << '$' << name << " << END\n";
  for (const Json& bin : figures["reliability"])
    text << bin["probability"] << ' ' << bin["frequency"] << ' ' << bin["count"] << '\n';
  text << "END\n";
  return text.str();
}

// gnuplot data: degrees, p(o|theta) at the learned scale, learned from virtual views (mean over models) and measured.
std::string CurveData(const CalibrationTrial& trial) {
  Models models;
  for (const JudgedModel& model : trial.models) models.push_back(&model);
  const measures::PredictedSuccess real = RealCurve(models);
  std::ostringstream text;
  text << "$curve << END\n";
  for (int deg = 0; deg <= 90; deg += 2) {
    const double learned =
        Mean(models, [deg](const JudgedModel& model) { return model.measures.predicted.Probability(deg * kDegree); });
    text << deg << ' ' << learned << ' ' << real.Probability(deg * kDegree) << '\n';
  }
  text << "END\n";
  return text.str();
}

constexpr const char* kPlot = R"(set terminal pngcairo size 1500,500
set output 'reliability.png'
set multiplot layout 1,3
set grid
set xrange [0:1]
set yrange [0:1]
set size square
set key top left
set ylabel 'share that was right'
set xlabel 'p(o|c)'
plot x with lines lc 'grey' notitle, $half with linespoints pt 6 title 'prior 1/2', $observed with linespoints pt 7 title 'prior of the data'
set xlabel 'p(o|theta)'
plot x with lines lc 'grey' notitle, $predicted with linespoints pt 7 title 'one view offered'
set xrange [0:90]
set xlabel 'rotation, degrees'
set ylabel 'p(o|theta) at the learned scale'
set key top right
plot $curve using 1:2 with lines lw 2 title 'virtual', $curve using 1:3 with lines lw 2 title 'real', 0.5 with lines lc 'grey' notitle
)";

}  // namespace

Json FiguresOf(const CalibrationTrial& trial, std::uint32_t seed) {
  Models all;
  std::map<int, Models> by_views;
  for (const JudgedModel& model : trial.models) {
    all.push_back(&model);
    by_views[model.views].push_back(&model);
  }
  Json figures;
  figures["frames_that_teach"] = trial.taught;
  figures["frames_to_learn_from"] = trial.offered;
  if (all.empty()) return figures;
  const auto count = [&](auto&& test) { return std::count_if(trial.frames.begin(), trial.frames.end(), test); };
  const double prior = PriorOf(all);
  figures["frames"] = count([](const auto& frame) { return frame.T_camera_mesh.has_value(); });
  figures["frames_with_object"] = count([](const auto& frame) { return frame.counts; });
  figures["absent_frames"] = count([](const auto& frame) { return !frame.T_camera_mesh; });
  figures["prior"] = prior;
  figures["pooled"] = FiguresOfModels(all, prior, seed);
  const bool drawn = std::none_of(all.begin(), all.end(), [](const JudgedModel* model) { return model->trials.empty(); });
  if (drawn) figures["pooled"]["observed_by_fit"] = FiguresOfFits(all, prior, seed);
  figures["per_views"] = Json::array();
  for (const auto& [views, models] : by_views) {
    Json entry = {{"views", views}};
    entry.update(FiguresOfModels(models, prior, seed));
    figures["per_views"].push_back(std::move(entry));
  }
  return figures;
}

std::string TableOf(const Json& figures) {
  if (!figures.contains("pooled")) {
    return "cannot be learned: " + figures["frames_that_teach"].dump() + " of " + figures["frames_to_learn_from"].dump() +
           " frames show enough of it\n";
  }
  const Json& pooled = figures["pooled"];
  char line[300];
  std::string text;
  const auto forecasts = [&](const char* name, const Json& of) {
    std::snprintf(line, sizeof line,
                  "%-26s %6d forecasts, %4.1f %% right; Brier %.3f, calibration error %.3f (95 %%: %.3f..%.3f)\n", name,
                  of["count"].get<int>(), 100.0 * of["right"].get<double>() / std::max(1, of["count"].get<int>()),
                  of["brier_score"].get<double>(), of["calibration_error"].get<double>(),
                  of["calibration_error_95"][0].get<double>(), of["calibration_error_95"][1].get<double>());
    text += line;
  };
  forecasts("p(o|c), prior of the data", pooled["observed"]);
  forecasts("p(o|c), prior 1/2", pooled["observed_prior_half"]);
  if (pooled.contains("observed_by_fit")) {
    for (const measures::ObservedFit fit : measures::kObservedFits) {
      const std::string name = measures::ToString(fit);
      forecasts(("  data's prior, " + name).c_str(), pooled["observed_by_fit"][name]);
    }
  }
  forecasts("p(o|theta)", pooled["predicted"]);
  text +=
      "                                        halves at, deg             completeness - detected, Brier score of single looks\n";
  text += "views  hypotheses  right  Brier  cal.err   virtual   real  detected ";
  for (const auto rule : measures::kCompletenessRules) {
    std::snprintf(line, sizeof line, " %13s", measures::ToString(rule).c_str());
    text += line;
  }
  text += "   common_cause, 95 %\n";
  const auto row = [&](const std::string& name, const Json& of) {
    const Json& observed = of["observed"];
    const Json& completeness = of["completeness"];
    std::snprintf(line, sizeof line, "%-6s %10d %6d %6.3f %8.3f %9.1f %6.1f %9.3f ", name.c_str(), observed["count"].get<int>(),
                  observed["right"].get<int>(), observed["brier_score"].get<double>(), observed["calibration_error"].get<double>(),
                  of["crossing"]["virtual_deg"].get<double>(), of["crossing"]["real_deg"].get<double>(),
                  completeness["detection_rate"].get<double>());
    text += line;
    for (const auto rule : measures::kCompletenessRules) {
      const Json& by_rule = completeness[measures::ToString(rule)];
      std::snprintf(line, sizeof line, "  %+6.3f %.3f", by_rule["difference"].get<double>(), by_rule["brier_score"].get<double>());
      text += line;
    }
    const Json& interval = completeness[measures::ToString(measures::CompletenessRule::kCommonCause)]["difference_95"];
    std::snprintf(line, sizeof line, "   %+.3f .. %+.3f\n", interval[0].get<double>(), interval[1].get<double>());
    text += line;
  };
  for (const Json& entry : figures["per_views"]) row(std::to_string(entry["views"].get<int>()), entry);
  row("all", pooled);
  return text;
}

void SaveCalibration(const CalibrationTrial& trial, const Json& figures, const std::string& where) {
  const fs::path folder = where;
  std::error_code failed;
  fs::create_directories(folder, failed);
  if (failed) throw std::runtime_error(where + ": cannot be made: " + failed.message());
  WriteWhole(folder / "hypotheses.csv", HypothesisTable(trial));
  WriteWhole(folder / "views.csv", ViewTable(trial));
  WriteWhole(folder / "trials.csv", TrialTable(trial));
  WriteWhole(folder / "models.csv", ModelTable(trial));
  WriteWhole(folder / "figures.json", figures.dump(2) + "\n");
  if (trial.models.empty()) return;
  const Json& pooled = figures["pooled"];
  WriteWhole(folder / "reliability.gnuplot", ReliabilityData("observed", pooled["observed"]) +
                                                 ReliabilityData("half", pooled["observed_prior_half"]) +
                                                 ReliabilityData("predicted", pooled["predicted"]) + CurveData(trial) + kPlot);
  RunGnuplot(folder / "reliability.gnuplot");
}

}  // namespace vantage::cli
