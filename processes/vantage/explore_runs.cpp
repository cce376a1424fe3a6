#include "vantage/explore_runs.h"

#include <cmath>
#include <random>
#include <sstream>

namespace vantage::cli {
namespace {

Json ToJson(const std::vector<std::pair<double, double>>& curve) {
  Json points = Json::array();
  for (const auto& [time_s, value] : curve) points.push_back({time_s, value});
  return points;
}

}  // namespace

Json ToJson(const session::ExploreResult& run) {
  Json entry;
  entry["strategy"] = run.strategy;
  entry["seed"] = run.seed;
  entry["views"] = run.views;
  entry["attempts"] = run.attempts;
  entry["failed_attempts"] = run.failed_attempts;
  entry["time_s"] = {
      {"plan", run.time.plan_s}, {"move", run.time.move_s}, {"learn", run.time.learn_s}, {"total", run.time.total_s()}};
  entry["completeness"] = Number(run.completeness);
  entry["completeness_over_time"] = ToJson(run.completeness_over_time);
  entry["true_rate_over_time"] = ToJson(run.true_rate_over_time);
  entry["true_detection_rate"] = run.true_detection_rate ? Number(*run.true_detection_rate) : Json(nullptr);
  entry["stop_reason"] = run.stop_reason;
  entry["attempts_made"] = Json::array();
  for (const session::ExploreAttempt& attempt : run.log) {
    entry["attempts_made"].push_back({{"time_s", attempt.time_s},
                                      {"predicted", Number(attempt.predicted)},
                                      {"detect_probability", Number(attempt.detect_probability)},
                                      {"gain", Number(attempt.gain)},
                                      {"nearest_view_deg", attempt.nearest_view_rad * 180.0 / M_PI},
                                      {"move_s", attempt.move_s},
                                      {"detected", attempt.detected},
                                      {"view_added", attempt.view_added},
                                      {"note", attempt.note}});
  }
  entry["audit"] = {{"paths", run.audit.paths},
                    {"touching", run.audit.touching},
                    {"clearance_m", run.audit.clearance_m},
                    {"nearest", run.audit.obstacle}};
  return entry;
}

session::ExploreParams ParamsOf(const ExploreOptions& options, const params::LibraryParams& params, const Scenario& scenario,
                                std::uint32_t seed) {
  session::ExploreParams explore;
  explore.learner = params.learner;
  explore.learner.recogniser = scenario.recogniser;
  explore.planner = params.planner;
  explore.candidates = params.candidates;
  explore.mount = params.mount;
  explore.trials = params.trials;
  explore.strategy = options.strategy;
  explore.judge_over_time = scenario.judge_over_time || options.judge_over_time;
  explore.judge_views_over_time = options.judge_views_over_time;
  explore.seed = seed;
  return explore;
}

session::ExploreResult RunOnce(const Scenario& scenario, const session::ExploreParams& params, const std::string& suffix,
                               model::Store* store, const std::function<void(const session::ExploreStep&)>& progress) {
  std::mt19937 random(params.seed);
  const std::size_t first = random() % scenario.starts.size();
  for (std::size_t i = 0;; ++i) {
    session::ExploreStart start = scenario.starts[(first + i) % scenario.starts.size()];
    start.object_name += suffix;
    try {
      if (store != nullptr) store->Remove(start.object_name);
      return session::Explore(*scenario.world, start, params, scenario.judge.get(), store, progress);
    } catch (const std::runtime_error& error) {
      const bool not_found = std::string(error.what()).rfind("no object was found", 0) == 0;
      if (!not_found || i + 1 == scenario.starts.size()) throw;
    }
  }
}

std::string SummaryOf(const session::ExploreResult& run) {
  std::ostringstream line;
  line.precision(3);
  line << run.strategy << ", seed " << run.seed << ": " << run.views << " views in " << run.attempts << " attempts, "
       << run.time.total_s() << " s; completeness " << run.completeness;
  if (run.true_detection_rate) line << ", true detection rate " << *run.true_detection_rate;
  line << "; stopped: " << run.stop_reason << '\n';
  return line.str();
}

}  // namespace vantage::cli
