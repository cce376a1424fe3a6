// vantage explore: the closed loop in lock step, on a virtual clock.
#include "session/explore.h"

#include <CLI/CLI.hpp>
#include <iostream>
#include <random>
#include <sstream>

#include "vantage/explore_runs.h"

namespace vantage::cli {
namespace {

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

void TellStep(const session::ExploreStep& step) {
  std::ostringstream line;
  line.precision(3);
  line << "  " << step.time_s << " s, attempt " << step.attempt << ": " << step.note << "; " << step.views
       << " views, completeness " << step.completeness << '\n';
  std::cout << line.str() << std::flush;
}

void RunExplore(const ExploreOptions& options) {
  if (!options.compare.empty()) return Compare(options);
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
      ->check(CLI::IsMember(exploration::StrategyNames()))
      ->capture_default_str();
  verb->add_option("--compare", options->compare,
                   "Compare strategies: every --mesh alone on a table, and the --sequence, are explored --runs times by each. Runs "
                   "are kept in DIR and not made again; table.txt, compare.json and plots go there too")
      ->type_name("DIR");
  verb->add_option("--strategies", options->strategies, "The strategies to compare (default: all)")
      ->check(CLI::IsMember(exploration::StrategyNames()))
      ->delimiter(',')
      ->type_name("NAMES");
  verb->add_flag("--quick", options->quick, "Compare with few attempts, trials and judging views: to see that it works");
  verb->add_option("--runs", options->runs, "Number of runs, with seeds from --seed on")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  verb->add_option("--judge-views", options->judge_views, "Fresh views that judge in a simulated world")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  verb->add_option("--judge-views-over-time", options->judge_views_over_time,
                   "So many of them judge after every view, all at the end; 0 = all")
      ->check(CLI::Range(0, 100000))
      ->capture_default_str();
  verb->add_flag("--judge-over-time", options->judge_over_time, "Judge after every view in a simulated world too");
  verb->add_option("--store", options->store, "Keep the learned objects in this store")->type_name("FILE");
  verb->callback([options, &run] { run = [options] { RunExplore(*options); }; });
}

}  // namespace vantage::cli
