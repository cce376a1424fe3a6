// The report's plots and its page.
#include <cmath>
#include <filesystem>
#include <sstream>

#include "measures/calibration.h"
#include "vantage/report.h"

namespace vantage::cli {
namespace {

namespace fs = std::filesystem;

constexpr double kDegree = M_PI / 180.0;
constexpr int kPanelPx = 360;
constexpr int kPanelWithKeyPx = 480;  // Its key stands beside it.
constexpr double kBinOfConfidence = 0.04;

// A gnuplot script: data blocks, then plots.
class Script {
 public:
  // A block of `columns`; returns its name.
  template <typename Rows>
  std::string Data(const Rows& rows) {
    const std::string name = "$data" + std::to_string(blocks_++);
    data_ << name << " << END\n";
    rows(data_);
    data_ << "END\n";
    return name;
  }

  // p over `from` to `to`.
  template <typename Curve>
  std::string Curve1(double from, double to, double step, const Curve& p) {
    return Data([&](std::ostream& data) {
      for (double x = from; x <= to + 1e-9; x += step) data << x << ' ' << p(x) << '\n';
    });
  }

  // An image of `panels` side by side; then a Panel() for each.
  void Figure(const std::string& name, int panels, int panel_px = kPanelPx) {
    Close();
    plots_ << "set terminal pngcairo size " << panel_px * panels << ',' << kPanelPx << "\nset output '" << name
           << ".png'\nset multiplot layout 1," << panels << "\nset grid\nset key samplen 1 font ',8'\n";
    open_ = true;
  }
  void Panel(const std::string& title, const std::string& settings, const std::vector<std::string>& plots) {
    plots_ << "set title " << Quoted(title) << " noenhanced\n" << settings << "\nplot ";
    for (std::size_t i = 0; i < plots.size(); ++i) plots_ << (i ? ", " : "") << plots[i];
    plots_ << "\n";
  }
  std::string Finish() {
    Close();
    return data_.str() + plots_.str();
  }

  static std::string Quoted(std::string text) {
    for (char& letter : text) {
      if (letter == '\'' || letter == '\n') letter = ' ';
    }
    return "'" + text + "'";
  }

 private:
  void Close() {
    if (open_) plots_ << "unset multiplot\n";
    open_ = false;
  }

  std::ostringstream data_, plots_;
  int blocks_ = 0;
  bool open_ = false;
};

const std::string kOverConfidence =
    "set xrange [0:1]\nset yrange [0:1]\nset xlabel 'confidence c'\nset ylabel 'p(o|c)'\nset key bottom right";
const std::string kOverRotation =
    "set xrange [0:90]\nset yrange [0:1]\nset xlabel 'rotation, degrees'\nset ylabel 'p(o|theta)'\nset key top right";

const std::string kKeyBeside = "\nset key outside right center";

std::string ObservedCurve(Script* script, const measures::ObservedSuccess& observed) {
  return script->Curve1(0.0, 1.0, 0.01, [&](double c) { return observed.Probability(c); });
}

std::string PredictedCurve(Script* script, const measures::PredictedSuccess& predicted) {
  return script->Curve1(0.0, 90.0, 1.0, [&](double deg) { return predicted.Probability(deg * kDegree); });
}

std::string Histogram(Script* script, const ReportObject& object, bool right) {
  std::vector<int> bins(static_cast<std::size_t>(1.0 / kBinOfConfidence) + 1);
  for (const assessment::Trial& trial : object.trials) {
    for (const assessment::Proposal& proposal : trial.together) {
      if (proposal.correct == right) ++bins[static_cast<std::size_t>(proposal.confidence / kBinOfConfidence)];
    }
  }
  return script->Data([&](std::ostream& data) {
    for (std::size_t i = 0; i < bins.size(); ++i)
      data << (static_cast<double>(i) + 0.5) * kBinOfConfidence << ' ' << bins[i] << '\n';
  });
}

std::string GaussianCurve(Script* script, const measures::Gaussian& gaussian) {
  return script->Curve1(0.0, 1.0, 0.01, [&](double c) {
    const double z = (c - gaussian.mean) / gaussian.sigma;
    return std::exp(-0.5 * z * z) / (gaussian.sigma * std::sqrt(2.0 * M_PI));
  });
}

// Shares detected in 5 degree steps about the learned scale: what p(o|theta) was fitted to.
std::string SharesOverRotation(Script* script, const ReportObject& object) {
  std::vector<double> of(18), detected(18);
  for (const assessment::Trial& trial : object.trials) {
    if (!trial.object_shown || std::abs(trial.log2_scale) > 0.5) continue;
    const auto cell = static_cast<std::size_t>(trial.rotation_rad / (5.0 * kDegree));
    if (cell >= of.size()) continue;
    of[cell] += 1.0;
    detected[cell] += trial.correct() && object.measures.observed.Probability(trial.confidence()) >= 0.5;
  }
  return script->Data([&](std::ostream& data) {
    for (std::size_t i = 0; i < of.size(); ++i) {
      if (of[i] > 0.0) data << 5.0 * static_cast<double>(i) + 2.5 << ' ' << detected[i] / of[i] << '\n';
    }
  });
}

std::string ReliabilityOf(Script* script, const std::vector<measures::Forecast>& forecasts) {
  return script->Data([&](std::ostream& data) {
    for (const auto& bin : measures::Reliability(forecasts, 15)) data << bin.mean_probability << ' ' << bin.frequency << '\n';
  });
}

std::string Errors(Script* script, const std::vector<ErrorBin>& bins) {
  return script->Data([&](std::ostream& data) {
    for (const ErrorBin& bin : bins) {
      data << bin.rotation_deg << ' ' << 100.0 * bin.mean_m << ' ' << 100.0 * bin.median_m << ' ' << 100.0 * bin.by_axis_m.x()
           << ' ' << 100.0 * bin.by_axis_m.y() << ' ' << 100.0 * bin.by_axis_m.z() << '\n';
    }
  });
}

// One panel for each object.
void PlotObjects(const Report& report, Script* script) {
  const int count = static_cast<int>(report.objects.size());
  script->Figure("06_histograms", count);
  for (const ReportObject& object : report.objects) {
    script->Panel(object.name,
                  "set xrange [0:1]\nset yrange [0:*]\nset xlabel 'confidence c'\nset ylabel 'proposals'\nset key top right",
                  {Histogram(script, object, true) + " with histeps lw 2 lc 'blue' title 'right'",
                   Histogram(script, object, false) + " with histeps lw 2 lc 'red' title 'wrong'"});
  }
  script->Figure("07_gaussians", count);
  for (const ReportObject& object : report.objects) {
    script->Panel(object.name, "set ylabel 'density'",
                  {GaussianCurve(script, object.measures.observed.positive()) + " with lines lw 2 lc 'blue' title 'right'",
                   GaussianCurve(script, object.measures.observed.negative()) + " with lines lw 2 lc 'red' title 'wrong'"});
  }
  script->Figure("08_observed", count);
  for (const ReportObject& object : report.objects) {
    script->Panel(object.name, kOverConfidence, {ObservedCurve(script, object.measures.observed) + " with lines lw 2 notitle"});
  }
  script->Figure("09_predicted", count);
  for (const ReportObject& object : report.objects) {
    script->Panel(
        object.name, kOverRotation,
        {PredictedCurve(script, object.measures.predicted) + " with lines lw 2 title 'fitted'",
         SharesOverRotation(script, object) + " with points pt 7 title 'share detected'", "0.5 with lines lc 'grey' notitle"});
  }
  script->Figure("15_thresholds", count);
  for (const ReportObject& object : report.objects) {
    std::vector<std::string> plots;
    for (const int cm : {2, 4, 6}) {
      plots.push_back(ObservedCurve(script, FitAt(report, object.trials, 0.01 * cm).observed) + " with lines lw 2 title '" +
                      std::to_string(cm) + " cm'");
    }
    script->Panel(object.name, kOverConfidence, plots);
  }
}

// One object's levels of noise, and photographs of it.
void PlotLevels(const Report& report, const ReportObject& object, Script* script) {
  std::vector<std::string> observed, predicted;
  for (const double noise : NoiseLevels(object.trials)) {
    const auto fitted = FitWhere(report, object.trials, [&](const auto& trial) { return trial.image_noise == noise; });
    const std::string style = " with lines title sprintf('noise %.0f', " + std::to_string(noise) + ")";
    observed.push_back(ObservedCurve(script, fitted.observed) + style);
    predicted.push_back(PredictedCurve(script, fitted.predicted) + style);
  }
  if (report.truth && report.truth->object == object.name) {
    const measures::Measures real = FitTruth(*report.truth);
    observed.push_back(ObservedCurve(script, real.observed) + " with lines lw 4 lc 'black' title 'real'");
    predicted.push_back(PredictedCurve(script, real.predicted) + " with lines lw 4 lc 'black' title 'real'");
  }
  script->Figure("10_observed_virtual_and_real", 2, kPanelWithKeyPx);
  script->Panel(object.name, kOverConfidence + kKeyBeside, observed);
  script->Panel(object.name + ", enlarged", kOverConfidence + kKeyBeside + "\nset xrange [0:0.5]", observed);
  script->Figure("12_predicted_virtual_and_real", 1, kPanelWithKeyPx);
  predicted.emplace_back("0.5 with lines lc 'grey' notitle");
  script->Panel(object.name, kOverRotation + kKeyBeside, predicted);
}

void PlotTogether(const Report& report, Script* script) {
  std::vector<std::string> observed, predicted, errors;
  for (const ReportObject& object : report.objects) {
    const std::string style = " with lines lw 2 title " + Script::Quoted(object.name) + " noenhanced";
    observed.push_back(ObservedCurve(script, object.measures.observed) + style);
    predicted.push_back(PredictedCurve(script, object.measures.predicted) + style);
    errors.push_back(Errors(script, ErrorOverRotation(object)) + " using 1:2 with linespoints title " +
                     Script::Quoted(object.name) + " noenhanced");
  }
  script->Figure("11_objects", 2, kPanelWithKeyPx);
  script->Panel("p(o|c)", kOverConfidence + kKeyBeside, observed);
  script->Panel("p(o|theta)", kOverRotation + kKeyBeside, predicted);
  const std::string axes =
      "set xrange [0:60]\nset yrange [0:12]\nset xlabel 'rotation, degrees'\nset ylabel 'mean error, cm'" + kKeyBeside;
  script->Figure("13_pose_error", report.truth ? 2 : 1, kPanelWithKeyPx);
  errors.emplace_back("4 with lines lc 'grey' notitle");
  script->Panel("virtual", axes, errors);
  if (!report.truth) return;
  const std::string real = Errors(script, ErrorOverRotation(*report.truth));
  script->Panel(report.truth->object + ", real", axes,
                {real + " using 1:4 with linespoints title 'x'", real + " using 1:5 with linespoints title 'y'",
                 real + " using 1:6 with linespoints title 'z (depth)'",
                 real + " using 1:2 with linespoints lw 2 lc 'black' title 'distance'",
                 real + " using 1:3 with lines dt 2 lc 'black' title 'distance, median'", "4 with lines lc 'grey' notitle"});
}

void PlotReliability(const Report& report, const ReportObject& object, Script* script) {
  std::vector<measures::Forecast> observed, predicted;
  for (const auto& hypothesis : report.truth->hypotheses) {
    observed.push_back({object.measures.observed.Probability(hypothesis.confidence), hypothesis.right});
  }
  for (const assessment::ViewTrial& trial : report.truth->view_trials) {
    const bool detected = assessment::IsDetected(trial, object.measures.observed);
    predicted.push_back({object.measures.predicted.Probability(trial.rotation_rad, trial.log2_scale), detected});
  }
  const std::string axes = "set xrange [0:1]\nset yrange [0:1]\nset ylabel 'share that was right'\nset key top left\nset xlabel ";
  const std::string diagonal = "x with lines lc 'grey' notitle";
  script->Figure("14_reliability", 2);
  script->Panel("every hypothesis, prior 1/2", axes + "'p(o|c)'",
                {diagonal, ReliabilityOf(script, observed) + " with linespoints pt 7 notitle"});
  script->Panel("one view offered", axes + "'p(o|theta)'",
                {diagonal, ReliabilityOf(script, predicted) + " with linespoints pt 7 notitle"});
}

std::string Escaped(const std::string& text) {
  std::string escaped;
  for (const char letter : text) {
    if (letter == '<')
      escaped += "&lt;";
    else if (letter == '&')
      escaped += "&amp;";
    else
      escaped += letter;
  }
  return escaped;
}

std::string ObservationTable(const std::vector<Observation>& observations) {
  std::ostringstream html;
  html << "<table><tr><th>object</th><th>the paper</th><th>here</th><th></th><th>what bears on it</th></tr>\n";
  for (const Observation& one : observations) {
    html << "<tr><td>" << Escaped(one.object.empty() ? "all" : one.object) << "</td><td>" << Escaped(one.claim) << "</td><td>"
         << Escaped(one.seen) << "</td><td class=" << (one.agrees ? "yes>agrees" : "no>differs") << "</td><td>" << Escaped(one.why)
         << "</td></tr>\n";
  }
  html << "</table>\n";
  return html.str();
}

struct Section {
  std::string plot;
  std::string title;
  std::string text;
};

std::vector<Section> Sections(const Report& report) {
  std::vector<Section> sections = {
      {"06_histograms", "Confidence of right and wrong proposals (Fig. 6)", "Of all proposals with all views on offer."},
      {"07_gaussians", "Their Gaussians (Fig. 7)", ""},
      {"08_observed", "Observed detection success (Fig. 8)", "p(o|c), prior 1/2."},
      {"09_predicted", "Predicted detection success (Fig. 9)", "p(o|theta) of one learned view at its own distance."},
      {"10_observed_virtual_and_real", "Observed detection success by levels of noise (Fig. 10)",
       "Levels in grey values; the thick curve is fitted on photographs."},
      {"11_objects", "Objects compared (Fig. 11)", ""},
      {"12_predicted_virtual_and_real", "Predicted detection success by levels of noise (Fig. 12)",
       "The thick curve is fitted on photographs."},
      {"13_pose_error", "Pose error over rotation (Fig. 13)",
       "Of the most likely proposal of one view; errors above 30 cm count as 30 cm. Real ones in camera coordinates."},
  };
  if (report.truth) {
    sections.push_back({"14_reliability", "Reliability on photographs",
                        "15 bins of equal mass, by the measures learned from virtual views. vantage evaluate calibration has the "
                        "figures over many models."});
  }
  sections.push_back({"15_thresholds", "What counts as right", "p(o|c) where a proposal is right below 2, 4 and 6 cm."});
  return sections;
}

std::string Page(const Report& report, const std::vector<Observation>& observations, const fs::path& folder) {
  std::ostringstream html;
  html << "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Measures</title>\n<style>\n"
          "body { font: 15px/1.5 sans-serif; max-width: 1100px; margin: 2em auto; padding: 0 1em; color: #222 }\n"
          "img { max-width: 100% } table { border-collapse: collapse } td, th { border-bottom: 1px solid #ddd; padding: .2em .8em "
          ".2em 0; text-align: left; vertical-align: top }\n.yes { color: #07704a } .no { color: #b03020 }\n</style></head><body>\n"
          "<h1>How well the measures know</h1>\n<table><tr><th>object</th><th>views</th><th>virtual images</th><th>p(o|c) = 1/2 "
          "at</th><th>p(o|theta) = 1/2 at</th></tr>\n";
  for (const ReportObject& object : report.objects) {
    double c = 0.0;
    while (c < 1.0 && object.measures.observed.Probability(c) < 0.5) c += 0.002;
    html << "<tr><td>" << Escaped(object.name) << "</td><td>" << object.views << "</td><td>" << object.trials.size() << "</td><td>"
         << std::round(100.0 * c) / 100.0 << "</td><td>"
         << std::round(10.0 * object.measures.predicted.HalfwayRotation() / kDegree) / 10.0 << "&deg;</td></tr>\n";
  }
  html << "</table>\n";
  if (report.truth) {
    html << "<p>Photographs: " << Escaped(report.truth->object) << " in "
         << Escaped(fs::path(report.truth->sequence).filename().string()) << ", " << report.truth->frames.size() << " frames, "
         << report.truth->hypotheses.size() << " hypotheses.</p>\n";
  }
  html << "<h2>What the paper saw, and what is seen here</h2>\n" << ObservationTable(observations);
  for (const Section& section : Sections(report)) {
    html << "<h2>" << section.title << "</h2>\n<p>" << section.text << "</p>\n";
    if (fs::exists(folder / (section.plot + ".png"))) {
      html << "<img src=\"" << section.plot << ".png\" alt=\"" << section.title << "\">\n";
    } else {
      html << "<p>(No plot: gnuplot was not found or failed; report.gnuplot has the data.)</p>\n";
    }
  }
  html << "</body></html>\n";
  return html.str();
}

}  // namespace

void SaveReport(const Report& report, const std::vector<Observation>& observations, const std::string& where) {
  const fs::path folder = where;
  Script script;
  PlotObjects(report, &script);
  const ReportObject* shown = &report.objects.at(0);
  for (const ReportObject& object : report.objects) {
    if (report.truth && report.truth->object == object.name) shown = &object;
  }
  PlotLevels(report, *shown, &script);
  PlotTogether(report, &script);
  if (report.truth) PlotReliability(report, *shown, &script);
  WriteWhole(folder / "report.gnuplot", script.Finish());
  RunGnuplot(folder / "report.gnuplot");
  WriteWhole(folder / "index.html", Page(report, observations, folder));
  WriteWhole(folder / "report.json",
             Json{{"observations", ToJson(observations)}}.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

}  // namespace vantage::cli
