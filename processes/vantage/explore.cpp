// vantage explore: the closed loop in lock step, on a virtual clock.
#include "session/explore.h"

#include <CLI/CLI.hpp>
#include <iostream>
#include <random>
#include <sstream>

#include "vantage/scenario.h"
#include "vantage/verb.h"

namespace vantage::cli {
namespace {

struct ExploreOptions {
  CommonOptions common;
  std::string sequence;
  int object_id = 0;  // 0 = not given.
  std::string world;
  std::vector<std::string> meshes;
  std::string object;
  std::string strategy = "planner";
  int runs = 1;
  int judge_views = 200;
  bool judge_over_time = false;
  std::string store;
};

Json ToJson(const std::vector<std::pair<double, double>>& curve) {
  Json points = Json::array();
  for (const auto& [time_s, value] : curve) points.push_back({time_s, value});
  return points;
}

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
  return entry;
}

void CheckChoice(const ExploreOptions& options) {
  const int worlds = static_cast<int>(!options.sequence.empty()) + static_cast<int>(!options.world.empty());
  if (worlds > 1) throw std::runtime_error("give either --sequence or --world, not both");
  if (worlds == 0 && options.meshes.empty())
    throw std::runtime_error("say where: --sequence DIR --object-id N, --world FILE, or --mesh FILE");
  if (!options.sequence.empty() && options.object_id == 0) throw std::runtime_error("--sequence needs --object-id N");
  if (!options.sequence.empty() && options.meshes.size() > 1)
    throw std::runtime_error("--sequence takes one --mesh, the object's own");
  if (!options.world.empty() && !options.meshes.empty()) throw std::runtime_error("--world names its own meshes; leave --mesh out");
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
  explore.seed = seed;
  return explore;
}

// One run. Where the object cannot be made out from a start, the next one is taken: which comes first is the seed's choice,
// whatever the strategy.
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

void TellStep(const session::ExploreStep& step) {
  std::ostringstream line;
  line.precision(3);
  line << "  " << step.time_s << " s, attempt " << step.attempt << ": " << step.note << "; " << step.views
       << " views, completeness " << step.completeness << '\n';
  std::cout << line.str() << std::flush;
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

void RunExplore(const ExploreOptions& options) {
  CheckChoice(options);
  CheckOutput(options.common);
  const params::LibraryParams params = LoadParams(options.common);
  const Scenario scenario =
      options.sequence.empty()
          ? SimulatedScenario(options.world, options.meshes, options.object, options.judge_views, params, options.common.seed)
          : RecordedScenario(options.sequence, options.object_id, options.meshes.empty() ? "" : options.meshes.front(), params);
  std::optional<model::Store> store;
  if (!options.store.empty()) store.emplace(options.store, model::Store::Mode::kWrite);

  const bool quiet = options.common.json == "-";
  Json result;
  result["judge_views"] = scenario.judge->size();
  result["runs"] = Json::array();
  std::string summary;
  for (int i = 0; i < options.runs; ++i) {
    const std::uint32_t seed = options.common.seed + static_cast<std::uint32_t>(i);
    if (!quiet) std::cout << "run " << i + 1 << " of " << options.runs << '\n';
    const session::ExploreResult run =
        RunOnce(scenario, ParamsOf(options, params, scenario, seed), options.runs > 1 ? " run " + std::to_string(i + 1) : "",
                store ? &*store : nullptr, quiet ? std::function<void(const session::ExploreStep&)>() : TellStep);
    result["runs"].push_back(ToJson(run));
    summary += SummaryOf(run);
  }
  WriteResult(options.common, result, summary);
}

}  // namespace

void AddExplore(CLI::App& app, Run& run) {
  auto options = std::make_shared<ExploreOptions>();
  CLI::App* verb = app.add_subcommand(
      "explore", "Explore an object: look, learn, assess, decide, move, until it is known or no view is worth its cost");
  AddCommonOptions(*verb, options->common);
  verb->add_option("--sequence", options->sequence, "Explore a recording: its even frames can be visited, its odd ones judge")
      ->type_name("DIR");
  verb->add_option("--object-id", options->object_id, "The object of scene_gt.json to explore")
      ->check(CLI::Range(1, 1000000))
      ->type_name("N");
  verb->add_option("--world", options->world, "Explore a simulated world")->type_name("FILE");
  verb->add_option("--mesh", options->meshes,
                   "Explore this mesh (OBJ or PLY) on a table; more meshes stand around it. With --sequence: the object's surface, "
                   "to judge by")
      ->type_name("FILE");
  verb->add_option("--object", options->object, "Name of the object of the world to explore (default: the first)")
      ->type_name("NAME");
  verb->add_option("--strategy", options->strategy, "How the next view is chosen")
      ->check(CLI::IsMember({"planner", "random"}))
      ->capture_default_str();
  verb->add_option("--runs", options->runs, "Number of runs, with seeds from --seed on")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  verb->add_option("--judge-views", options->judge_views, "Fresh views that judge in a simulated world")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  verb->add_flag("--judge-over-time", options->judge_over_time, "Judge after every view in a simulated world too");
  verb->add_option("--store", options->store, "Keep the learned objects in this store")->type_name("FILE");
  verb->callback([options, &run] { run = [options] { RunExplore(*options); }; });
}

}  // namespace vantage::cli
