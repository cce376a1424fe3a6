// The figures of a learner's trial, its tables and its plot.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "vantage/learner_trial.h"

namespace vantage::cli {
namespace {

namespace fs = std::filesystem;

double Round(double value) { return std::round(value * 1e3) / 1e3; }
Json Rounded(double value) { return Number(Round(value)); }

Json TrackingFigures(const std::vector<TrialStep>& steps) {
  int usable = 0, tracked = 0, wrong = 0;
  std::vector<PoseError> errors;
  for (const TrialStep& step : steps) {
    usable += step.truth.usable;
    tracked += step.truth.usable && step.tracked && !step.wrong;
    wrong += step.wrong;
    if (step.error && step.truth.usable) errors.push_back(*step.error);
  }
  Json figures;
  figures["usable"] = usable;
  figures["tracked"] = tracked;  // Of the usable, and right.
  figures["tracked_share"] = usable > 0 ? Rounded(static_cast<double>(tracked) / usable) : Json(nullptr);
  figures["wrong"] = wrong;
  figures["error"] = ErrorFigures(errors);
  return figures;
}

Json ViewFigures(const LearnerTrial& trial) {
  std::vector<PoseError> errors;
  int wrong = 0, without_object = 0;
  for (const ViewError& view : trial.ViewErrors()) {
    wrong += view.wrong();
    without_object += !view.error;
    if (view.error) errors.push_back(*view.error);
  }
  int wrong_at_worst = 0, frames_with_wrong = 0;
  for (const TrialStep& step : trial.steps()) {
    wrong_at_worst = std::max(wrong_at_worst, step.wrong_views);
    frames_with_wrong += step.wrong_views > 0;
  }
  Json figures;
  figures["count"] = errors.size() + static_cast<std::size_t>(without_object);
  figures["wrong"] = wrong;                    // Off by more than 20 mm or 5 degrees, or without the object.
  figures["wrong_at_worst"] = wrong_at_worst;  // On the way: drift that was not closed yet counts.
  figures["frames_with_wrong"] = frames_with_wrong;
  figures["without_object"] = without_object;
  figures["error"] = ErrorFigures(errors);
  return figures;
}

// How long after the fault the object was tracked (and rightly) again: from the first usable frame on. null = never.
Json FaultFigures(const std::vector<TrialStep>& steps) {
  const auto last = std::find_if(steps.rbegin(), steps.rend(), [](const TrialStep& step) { return step.truth.faulty; });
  if (last == steps.rend()) return nullptr;
  Json figures;
  int tracked_wrongly = 0;
  for (const TrialStep& step : steps) tracked_wrongly += step.truth.faulty && step.wrong;
  figures["tracked_wrongly"] = tracked_wrongly;
  figures["lasts_to_the_end"] = last == steps.rbegin();
  figures["tracked_again_after_s"] = nullptr;
  std::optional<double> usable_from_s;
  for (auto step = last.base(); step != steps.end(); ++step) {
    if (step->truth.usable && !usable_from_s) usable_from_s = step->truth.time_s;
    if (usable_from_s && step->tracked && !step->wrong) {
      figures["tracked_again_after_s"] = Rounded(step->truth.time_s - *usable_from_s);
      break;
    }
  }
  return figures;
}

Json Spread(const std::vector<double>& values) {
  return {{"median", Rounded(Quantile(values, 0.5))},
          {"p95", Rounded(Quantile(values, 0.95))},
          {"max", Rounded(Quantile(values, 1.0))}};
}

// Whether time and memory stay flat: of every thousand frames the median time of the processor, and where memory stands at their
// end.
Json EveryThousand(const std::vector<TrialStep>& steps) {
  constexpr std::size_t kFrames = 1000;
  Json thousands = Json::array();
  for (std::size_t end = kFrames; end <= steps.size(); end += kFrames) {
    std::vector<double> cpu_ms;
    for (std::size_t i = end - kFrames; i < end; ++i) cpu_ms.push_back(steps[i].cpu_ms);
    thousands.push_back({{"frames", end},
                         {"cpu_ms", Rounded(Quantile(cpu_ms, 0.5))},
                         {"memory_mb", Rounded(steps[end - 1].memory_mb)},
                         {"views", steps[end - 1].views}});
  }
  return thousands;
}

std::string Quoted(std::string text) {
  std::replace(text.begin(), text.end(), '"', '\'');
  return '"' + text + '"';
}

std::string FrameTable(const LearnerTrial& trial) {
  std::ostringstream table;
  table.precision(6);
  table << "frame,time_s,circle,faulty,usable,state,tracked,wrong,error_mm,error_deg,confidence,probability,inliers,spread_mm,"
           "spread_deg,likeness,reference_view,"
           "view_added,views,wrong_views,points,ms,cpu_ms,memory_mb,note\n";
  for (const TrialStep& step : trial.steps()) {
    const learning::LearnerResult& result = step.result;
    table << step.frame_id << ',' << step.truth.time_s << ',' << step.truth.circle << ',' << step.truth.faulty << ','
          << step.truth.usable << ',' << learning::ToString(result.state) << ',' << step.tracked << ',' << step.wrong << ',';
    if (step.error)
      table << step.error->translation_mm << ',' << step.error->rotation_deg;
    else
      table << "NaN,NaN";
    table << ',' << result.confidence.value << ',' << result.probability << ',' << result.inliers << ','
          << 1e3 * result.spread.sigma_m << ',' << result.spread.sigma_rad * 180.0 / M_PI << ',' << result.likeness.value_or(NAN)
          << ',' << result.reference_view << ',' << result.view_added << ',' << step.views << ',' << step.wrong_views << ','
          << step.points << ',' << step.ms << ',' << step.cpu_ms << ',' << step.memory_mb << ',' << Quoted(result.note) << '\n';
  }
  return table.str();
}

std::string ViewTable(const LearnerTrial& trial) {
  std::ostringstream table;
  table.precision(6);
  table << "view,frame,wrong,error_mm,error_deg\n";
  for (const ViewError& view : trial.ViewErrors()) {
    table << view.id << ',' << view.frame_id << ',' << view.wrong() << ',';
    if (view.error)
      table << view.error->translation_mm << ',' << view.error->rotation_deg << '\n';
    else
      table << "NaN,NaN\n";
  }
  return table.str();
}

const char* const kPlot = R"(set terminal pngcairo size 1400,1100 font 'sans,10'
set output 'plot.png'
set datafile separator ','
set key outside right top
set grid
set multiplot layout 4,1 title TITLE noenhanced
set ylabel 'error'
set yrange [0:*<30]
plot 'frames.csv' using 'time_s':'error_mm' with points pt 7 ps 0.4 title 'frame, mm', '' using 'time_s':'error_deg' with points pt 7 ps 0.4 title 'frame, deg', 'views.csv' using (TIME(column('frame'))):'error_mm' with points pt 6 ps 1.5 title 'view at the end, mm'
set ylabel 'c, p(o|c)'
set yrange [0:1.05]
plot 'frames.csv' using 'time_s':'confidence' with lines title 'c', '' using 'time_s':'probability' with lines title 'p(o|c)', '' using 'time_s':'tracked' with dots title 'tracked', '' using 'time_s':(column('faulty')*0.5) with filledcurves y1=0 fs transparent solid 0.2 title 'fault'
set ylabel 'ms'
set yrange [0:*]
plot 'frames.csv' using 'time_s':'ms' with points pt 7 ps 0.3 title 'wall', '' using 'time_s':'cpu_ms' with points pt 7 ps 0.3 title 'processor'
set ylabel 'views'
set xlabel 'time, s'
set y2tics
plot 'frames.csv' using 'time_s':'views' with lines title 'views', '' using 'time_s':'points' axes x1y2 with lines title 'points (right)', '' using 'time_s':'memory_mb' axes x1y2 with lines title 'memory, MB (right)'
)";

}  // namespace

Json ErrorFigures(const std::vector<PoseError>& errors) {
  std::vector<double> mm, deg;
  for (const PoseError& error : errors) {
    mm.push_back(error.translation_mm);
    deg.push_back(error.rotation_deg);
  }
  return {{"mm", Spread(mm)}, {"deg", Spread(deg)}};
}

Json FiguresOf(const LearnerTrial& trial) {
  const std::vector<TrialStep>& steps = trial.steps();
  std::vector<double> ms, cpu_ms;
  for (const TrialStep& step : steps) {
    ms.push_back(step.ms);
    cpu_ms.push_back(step.cpu_ms);
  }
  Json figures;
  figures["frames"] = steps.size();
  figures["tracking"] = TrackingFigures(steps);
  figures["views"] = ViewFigures(trial);
  figures["after_fault"] = FaultFigures(steps);
  figures["ms"] = Spread(ms);
  figures["cpu_ms"] = Spread(cpu_ms);
  figures["every_thousand"] = EveryThousand(steps);
  figures["memory_mb"] = {{"first", Rounded(steps.empty() ? NAN : steps.front().memory_mb)},
                          {"last", Rounded(steps.empty() ? NAN : steps.back().memory_mb)}};
  return figures;
}

Json PointFigures(const LearnerTrial& trial, const rendering::SurfaceDistance& surface) {
  Json figures;
  const auto object = trial.learner().object();
  if (!object || !trial.T_mesh_object()) return nullptr;
  std::vector<double> mm;
  for (const double distance_m : surface.Of(*trial.T_mesh_object() * object->PointMatrix())) mm.push_back(1e3 * distance_m);
  figures["count"] = mm.size();
  figures["surface_mm"] = Spread(mm);
  return figures;
}

std::string SummaryOf(const Json& figures) {
  std::ostringstream text;
  const Json& tracking = figures["tracking"];
  const Json& views = figures["views"];
  text << figures["object"].get<std::string>() << ": tracked " << tracking["tracked"] << " of " << tracking["usable"]
       << " usable frames (" << tracking["wrong"] << " wrong), error " << tracking["error"]["mm"]["median"] << " mm "
       << tracking["error"]["deg"]["median"] << " deg (median), max " << tracking["error"]["mm"]["max"] << " mm\n  "
       << views["count"] << " views (" << views["wrong"] << " wrong; on the way " << views["wrong_at_worst"] << " at worst, in "
       << views["frames_with_wrong"] << " frames), error " << views["error"]["mm"]["median"] << " mm "
       << views["error"]["deg"]["median"] << " deg, max " << views["error"]["mm"]["max"] << " mm " << views["error"]["deg"]["max"]
       << " deg\n  ";
  if (figures.contains("points") && !figures["points"].is_null()) {
    text << figures["points"]["count"] << " points, " << figures["points"]["surface_mm"]["median"] << " mm from the surface (p95 "
         << figures["points"]["surface_mm"]["p95"] << ")\n  ";
  }
  for (const Json& circle : figures.value("circles", Json::array())) {
    for (const char* second : {"worst_second", "last_second"}) {
      const Json& figure = circle[second];
      text << (*second == 'w' ? "circle: worst second " : "; last second ") << figure["as_tracked"]["mm"]["median"] << " mm "
           << figure["as_tracked"]["deg"]["median"] << " deg as tracked, " << figure["by_final_model"]["mm"]["median"] << " mm "
           << figure["by_final_model"]["deg"]["median"] << " deg by the final model (" << figure["placed"] << " of "
           << figure["tried"] << " placed)";
    }
    text << "\n  ";
  }
  if (!figures["after_fault"].is_null()) {
    const Json& after = figures["after_fault"];
    text << "fault " << figures["fault"].get<std::string>() << ": ";
    if (!after["lasts_to_the_end"].get<bool>()) text << "tracked again after " << after["tracked_again_after_s"] << " s, ";
    text << "tracked wrongly in " << after["tracked_wrongly"] << " frames of it\n  ";
  }
  if (figures.contains("found")) {
    const Json& found = figures["found"];
    text << "found in " << found["right"] << " of " << found["frames"] << " frames (" << found["wrong"] << " wrong), error "
         << found["error"]["mm"]["median"] << " mm " << found["error"]["deg"]["median"] << " deg, max "
         << found["error"]["mm"]["max"] << " mm " << found["error"]["deg"]["max"] << " deg\n  ";
  }
  text << figures["ms"]["median"] << " ms a frame (p95 " << figures["ms"]["p95"] << "), of the processor "
       << figures["cpu_ms"]["median"] << " (p95 " << figures["cpu_ms"]["p95"] << "); memory " << figures["memory_mb"]["first"]
       << " -> " << figures["memory_mb"]["last"] << " MB\n";
  for (const Json& part : figures.value("every_thousand", Json::array())) {
    text << "  after " << part["frames"] << " frames: " << part["cpu_ms"] << " ms of the processor (median of the last thousand), "
         << part["memory_mb"] << " MB, " << part["views"] << " views\n";
  }
  return text.str();
}

void SaveTrial(const LearnerTrial& trial, const std::string& title, const fs::path& folder) {
  std::error_code failed;
  fs::create_directories(folder, failed);
  if (failed) throw std::runtime_error(folder.string() + ": cannot be made: " + failed.message());
  WriteWhole(folder / "frames.csv", FrameTable(trial));
  WriteWhole(folder / "views.csv", ViewTable(trial));
  // Frame numbers of views to times: frames come evenly.
  const std::vector<TrialStep>& steps = trial.steps();
  double first_s = 0.0, per_frame_s = 1.0;
  if (steps.size() > 1) {
    per_frame_s = (steps.back().truth.time_s - steps.front().truth.time_s) /
                  static_cast<double>(std::max<std::int64_t>(1, steps.back().frame_id - steps.front().frame_id));
    first_s = steps.front().truth.time_s - per_frame_s * static_cast<double>(steps.front().frame_id);
  }
  std::ostringstream plot;
  plot << "TITLE = " << Quoted(title) << "\nTIME(frame) = " << first_s << " + " << per_frame_s << " * frame\n" << kPlot;
  WriteWhole(folder / "plot.gnuplot", plot.str());
  RunGnuplot(folder / "plot.gnuplot");
}

}  // namespace vantage::cli
