// What the runs of a comparison say: times, ratios, curves.
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <set>
#include <sstream>

#include "vantage/explore_runs.h"

namespace vantage::cli {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr double kShareOfBest = 0.9;
constexpr double kWantedRate = 0.85;
constexpr int kResamples = 2000;
constexpr int kPlotSteps = 120;

using Key = std::pair<std::string, int>;  // World and seed: what runs of different strategies have in common.

struct Row {
  double time_s = kNever;       // To the wanted share of the best reachable completeness.
  double views = kNever;        // Learned until then.
  double looks = kNever;        // Views gone to until then, whether they were learned or not.
  double rate_time_s = kNever;  // To a true detection rate of 0.85, or of 0.9 of the best where that is less.
  double error = 0.0;           // |completeness - true rate| at the stop.
};

double FirstTime(const Json& curve, double wanted) {
  for (const Json& point : curve) {
    if (point[1].get<double>() >= wanted) return point[0].get<double>();
  }
  return kNever;
}

int ViewsUntil(const Json& curve, double wanted) {
  int views = 0;
  for (const Json& point : curve) {
    ++views;
    if (point[1].get<double>() >= wanted) return views;
  }
  return std::numeric_limits<int>::max();
}

// The first one is where the run begins.
int LooksUntil(const Json& attempts, double time_s) {
  constexpr double kRounding_s = 1e-6;
  return 1 + static_cast<int>(std::count_if(attempts.begin(), attempts.end(), [&](const Json& attempt) {
           return attempt["time_s"].get<double>() <= time_s + kRounding_s;
         }));
}

// The greatest value of a curve that any run in a world came to.
std::map<std::string, double> BestOf(const std::vector<Json>& runs, const char* curve) {
  std::map<std::string, double> best;
  for (const Json& run : runs) {
    for (const Json& point : run[curve]) {
      double& so_far = best[run["world"].get<std::string>()];
      so_far = std::max(so_far, point[1].get<double>());
    }
  }
  return best;
}

// The median, infinite where half of the values are.
double Median(std::vector<double> values) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  const double low = values[(values.size() - 1) / 2], high = values[values.size() / 2];
  return std::isfinite(high) ? 0.5 * (low + high) : high;
}

struct Interval {
  double median, low, high;
};

// The median with its 90 % bootstrap interval.
Interval MedianInterval(const std::vector<double>& values) {
  std::mt19937 random(1);
  std::vector<double> medians;
  for (int i = 0; i < kResamples && !values.empty(); ++i) {
    std::vector<double> sample;
    for (std::size_t k = 0; k < values.size(); ++k) sample.push_back(values[random() % values.size()]);
    medians.push_back(Median(sample));
  }
  std::sort(medians.begin(), medians.end());
  if (medians.empty()) return {std::nan(""), std::nan(""), std::nan("")};
  return {Median(values), medians[medians.size() / 20], medians[medians.size() - 1 - medians.size() / 20]};
}

// a / b of the same world and seed; where only b never got there 0, where only a did not infinite, where both did not 1.
double Ratio(double a, double b) {
  if (std::isfinite(a) && std::isfinite(b)) return b > 0.0 ? a / b : 1.0;
  if (!std::isfinite(a) && !std::isfinite(b)) return 1.0;
  return std::isfinite(a) ? 0.0 : kNever;
}

std::vector<double> Ratios(const std::map<Key, Row>& ours, const std::map<Key, Row>& theirs, double Row::*value) {
  std::vector<double> ratios;
  for (const auto& [key, row] : ours) {
    const auto other = theirs.find(key);
    if (other != theirs.end()) ratios.push_back(Ratio(row.*value, other->second.*value));
  }
  return ratios;
}

std::vector<double> Values(const std::map<Key, Row>& rows, double Row::*value) {
  std::vector<double> values;
  for (const auto& [key, row] : rows) values.push_back(row.*value);
  return values;
}

std::string Text(double value, int digits) {
  if (std::isnan(value)) return "-";
  if (!std::isfinite(value)) return "never";
  std::ostringstream text;
  text.setf(std::ios::fixed);
  text.precision(digits);
  text << value;
  return text.str();
}

std::string Text(const Interval& interval, int digits) {
  return Text(interval.median, digits) + " [" + Text(interval.low, digits) + ", " + Text(interval.high, digits) + "]";
}

Json ToJson(const Interval& interval) { return {Number(interval.median), Number(interval.low), Number(interval.high)}; }

void Pad(std::string& line, std::size_t column) {
  line += ' ';
  if (line.size() < column) line.append(column - line.size(), ' ');
}

// The figures of one group of worlds.
CompareFigures Group(const std::vector<Json>& runs, const std::vector<std::string>& strategies, const std::string& name) {
  const std::map<std::string, double> best = BestOf(runs, "completeness_over_time");
  const std::map<std::string, double> best_rate = BestOf(runs, "true_rate_over_time");
  std::map<std::string, std::map<Key, Row>> rows;
  std::map<std::string, std::map<std::string, int>> stops;
  int paths = 0, touching = 0;
  double clearance_m = kNever;
  for (const Json& run : runs) {
    const auto world = run["world"].get<std::string>();
    const auto strategy = run["strategy"].get<std::string>();
    const double wanted = kShareOfBest * best.at(world);
    Row row;
    row.time_s = FirstTime(run["completeness_over_time"], wanted);
    if (std::isfinite(row.time_s)) {
      row.views = ViewsUntil(run["completeness_over_time"], wanted);
      row.looks = LooksUntil(run["attempts_made"], row.time_s);
    }
    const auto most = best_rate.find(world);
    const double wanted_rate = most == best_rate.end() ? kWantedRate : std::min(kWantedRate, kShareOfBest * most->second);
    row.rate_time_s = FirstTime(run["true_rate_over_time"], wanted_rate);
    row.error = std::abs(run["completeness"].get<double>() - run["true_detection_rate"].get<double>());
    rows[strategy][{world, run["seed"].get<int>()}] = row;
    ++stops[strategy][run["stop_reason"].get<std::string>()];
    paths += run["audit"]["paths"].get<int>();
    touching += run["audit"]["touching"].get<int>();
    clearance_m = std::min(clearance_m, run["audit"]["clearance_m"].get<double>());
  }

  CompareFigures result;
  std::ostringstream table;
  table << name << ": " << runs.size()
        << " runs; medians with 90 % intervals; ratios are planner / strategy, paired by world and seed\n";
  std::string head = "  strategy";
  const std::vector<std::pair<std::string, std::size_t>> columns{
      {"runs", 12},  {"s to 0.9 of best", 18}, {"ratio", 44},  {"views", 64},   {"ratio", 71}, {"looks", 90},
      {"ratio", 97}, {"s to rate 0.85", 116},  {"ratio", 142}, {"|error|", 162}};
  for (const auto& [title, column] : columns) {
    Pad(head, column);
    head += title;
  }
  table << head << '\n';
  Json figures = Json::object();
  for (const std::string& strategy : strategies) {
    if (rows[strategy].empty()) continue;
    const auto& ours = rows["planner"];
    const auto& theirs = rows[strategy];
    const Interval time = MedianInterval(Values(theirs, &Row::time_s));
    const Interval time_ratio = MedianInterval(Ratios(ours, theirs, &Row::time_s));
    const Interval view_ratio = MedianInterval(Ratios(ours, theirs, &Row::views));
    const Interval rate_time = MedianInterval(Values(theirs, &Row::rate_time_s));
    const Interval rate_ratio = MedianInterval(Ratios(ours, theirs, &Row::rate_time_s));
    const Interval look_ratio = MedianInterval(Ratios(ours, theirs, &Row::looks));
    const double views = Median(Values(theirs, &Row::views)), looks = Median(Values(theirs, &Row::looks));
    const double error = Median(Values(theirs, &Row::error));
    const auto unless = [](bool unused, const std::string& text) { return unused ? std::string() : text; };
    const bool is_planner = strategy == "planner";
    const bool is_oracle = strategy == "oracle";  // It works for the true rate and knows of no completeness.
    const std::vector<std::string> cells{std::to_string(theirs.size()),
                                         unless(is_oracle, Text(time, 1)),
                                         unless(is_planner || is_oracle, Text(time_ratio, 2)),
                                         unless(is_oracle, Text(views, 0)),
                                         unless(is_planner || is_oracle, Text(view_ratio, 2)),
                                         unless(is_oracle, Text(looks, 0)),
                                         unless(is_planner || is_oracle, Text(look_ratio, 2)),
                                         Text(rate_time, 1),
                                         unless(is_planner, Text(rate_ratio, 2)),
                                         Text(error, 3)};
    std::string line = "  " + strategy;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      Pad(line, columns[i].second);
      line += cells[i];
    }
    table << line << '\n';
    Json stopped = Json::object();
    for (const auto& [reason, count] : stops[strategy]) stopped[reason] = count;
    figures[strategy] = {{"runs", theirs.size()},
                         {"time_s", ToJson(time)},
                         {"planner_time_ratio", ToJson(time_ratio)},
                         {"views", Number(views)},
                         {"planner_views_ratio", ToJson(view_ratio)},
                         {"looks", Number(looks)},
                         {"planner_looks_ratio", ToJson(look_ratio)},
                         {"time_to_rate_s", ToJson(rate_time)},
                         {"planner_time_to_rate_ratio", ToJson(rate_ratio)},
                         {"completeness_error", Number(error)},
                         {"stopped", stopped}};
  }
  table << "  paths checked " << paths << ", touching " << touching << ", least clearance " << Text(clearance_m, 4) << " m\n";
  result.figures = {
      {"name", name}, {"strategies", figures}, {"paths", paths}, {"touching", touching}, {"clearance_m", Number(clearance_m)}};
  result.table = table.str();
  return result;
}

std::map<std::string, std::vector<Json>> ByWorld(const std::vector<Json>& runs) {
  std::map<std::string, std::vector<Json>> worlds;
  for (const Json& run : runs) worlds[run["world"].get<std::string>()].push_back(run);
  return worlds;
}

// The value of a curve of steps at a time; 0 before its first point.
double ValueAt(const Json& curve, double time_s) {
  double value = 0.0;
  for (const Json& point : curve) {
    if (point[0].get<double>() > time_s) break;
    value = point[1].get<double>();
  }
  return value;
}

// Blocks of "time median lower-quartile upper-quartile", one for a strategy; empty where there are no such curves.
std::string CurveData(const std::vector<Json>& runs, const std::vector<std::string>& strategies, const char* curve, double end_s) {
  std::ostringstream data;
  for (const std::string& strategy : strategies) {
    data << "\"" << strategy << "\"\n";
    for (int i = 0; i <= kPlotSteps; ++i) {
      const double time_s = end_s * i / kPlotSteps;
      std::vector<double> values;
      for (const Json& run : runs) {
        if (run["strategy"] == strategy) values.push_back(ValueAt(run[curve], time_s));
      }
      if (values.empty()) continue;
      data << time_s << ' ' << Quantile(values, 0.5) << ' ' << Quantile(values, 0.25) << ' ' << Quantile(values, 0.75) << '\n';
    }
    data << "\n\n";
  }
  return data.str();
}

void Plot(const std::vector<Json>& runs, const std::vector<std::string>& strategies, const std::string& name,
          const std::filesystem::path& folder) {
  double end_s = 1.0;
  for (const Json& run : runs) {
    if (run["strategy"] != "random") end_s = std::max(end_s, run["time_s"]["total"].get<double>());
  }
  std::vector<std::string> present;
  for (const std::string& strategy : strategies) {
    if (std::any_of(runs.begin(), runs.end(), [&](const Json& run) { return run["strategy"] == strategy; }))
      present.push_back(strategy);
  }
  WriteWhole(folder / (name + ".completeness.dat"), CurveData(runs, present, "completeness_over_time", end_s));
  WriteWhole(folder / (name + ".rate.dat"), CurveData(runs, present, "true_rate_over_time", end_s));
  std::ostringstream plot;
  plot << "set terminal pngcairo size 1100,900 noenhanced\nset output '" << name << ".png'\nset multiplot layout 2,1 title '"
       << name << ": median and quartiles of the runs'\nset key outside\nset grid\nset yrange [0:1]\nset xrange [0:" << end_s
       << "]\nset style fill transparent solid 0.12 noborder\nset xlabel 'robot time, s'\nN = " << present.size()
       << "\nCURVES(file) = sprintf(\"plot for [i=0:%d] '%s' index i using 1:3:4 skip 1 with filledcurves lt i+1 notitle, "
          "for [i=0:%d] '%s' index i using 1:2 with lines lw 2 lt i+1 title columnheader(1)\", N-1, file, N-1, file)\n"
       << "set ylabel 'completeness'\neval CURVES('" << name
       << ".completeness.dat')\nset ylabel 'true detection rate'\neval CURVES('" << name << ".rate.dat')\nunset multiplot\n";
  WriteWhole(folder / (name + ".gnuplot"), plot.str());
  RunGnuplot(std::filesystem::absolute(folder / (name + ".gnuplot")));
}

}  // namespace

CompareFigures FiguresOf(const std::vector<Json>& runs, const std::vector<std::string>& strategies) {
  CompareFigures all;
  all.figures = {{"groups", Json::array()}};
  const auto add = [&](const std::vector<Json>& group, const std::string& name) {
    const CompareFigures figures = Group(group, strategies, name);
    all.figures["groups"].push_back(figures.figures);
    all.table += figures.table + "\n";
  };
  const auto worlds = ByWorld(runs);
  if (worlds.size() > 1) add(runs, "all");
  for (const auto& [world, group] : worlds) add(group, world);
  return all;
}

void PlotRuns(const std::vector<Json>& runs, const std::vector<std::string>& strategies, const std::filesystem::path& folder) {
  const auto worlds = ByWorld(runs);
  if (worlds.size() > 1) Plot(runs, strategies, "all", folder);
  for (const auto& [world, group] : worlds) Plot(group, strategies, world, folder);
}

}  // namespace vantage::cli
