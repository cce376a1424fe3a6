// vantage explore --compare: every strategy in every world with every seed, each run kept on disk.
#include <cstdio>
#include <fstream>
#include <functional>
#include <iostream>
#include <optional>

#include "session/outcomes.h"
#include "vantage/explore_runs.h"

namespace vantage::cli {
namespace {

namespace fs = std::filesystem;

// Made when the first run in it is wanted.
struct World {
  std::string name;
  std::function<Scenario()> make;
  std::optional<Scenario> scenario;
  exploration::OutcomeTable outcomes;
};

void MakeQuick(params::LibraryParams& params) {
  params.trials.trials_per_view = 8;
  params.trials.negatives_per_view = 2;
  params.planner.max_attempts = std::min(params.planner.max_attempts, 3);
  params.candidates.directions = std::min(params.candidates.directions, 30);
}

// All that the result of a run depends on beside world, strategy and seed; two comparisons must not be mixed.
std::string SettingsOf(const ExploreOptions& options, const params::LibraryParams& params) {
  std::string text = "judge_views=" + std::to_string(options.judge_views) + "/" + std::to_string(options.judge_views_over_time) +
                     (options.quick ? " quick" : "");
  for (const auto& [key, value] : params::Flatten(params)) text += " " + key + "=" + value;
  std::uint64_t hash = 1469598103934665603ull;  // FNV-1a.
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ull;
  char word[17];
  std::snprintf(word, sizeof word, "%016llx", static_cast<unsigned long long>(hash));
  return word;
}

std::optional<Json> ReadJson(const fs::path& file) {
  std::ifstream stream(file);
  if (!stream) return std::nullopt;
  Json json = Json::parse(stream, nullptr, false);
  if (json.is_discarded()) return std::nullopt;
  return json;
}

std::optional<Json> ReadOwn(const fs::path& file, const std::string& settings) {
  std::optional<Json> json = ReadJson(file);
  if (json && json->value("settings", "") != settings) {
    throw std::runtime_error(file.string() + ": was made with other parameters; give --compare another folder");
  }
  return json;
}

std::string WorldName(const std::string& mesh_or_folder) {
  const fs::path path = fs::absolute(mesh_or_folder).lexically_normal();
  const std::string stem = path.has_filename() ? path.stem().string() : path.parent_path().filename().string();
  const bool generic = stem.rfind("textured", 0) == 0 || stem == "mesh" || stem == "model";
  return generic ? path.parent_path().filename().string() : stem;
}

// The table of outcomes from disk, or made and kept there.
exploration::OutcomeTable OutcomesOf(const World& world, const session::ExploreParams& params, const fs::path& file,
                                     const std::string& settings) {
  exploration::OutcomeTable table;
  if (const auto json = ReadOwn(file, settings)) {
    for (const Json& entry : json->at("viewpoints")) {
      table.viewpoints.push_back(
          {Eigen::Vector3d(entry[0].get<double>(), entry[1].get<double>(), entry[2].get<double>()), entry[3].get<double>()});
    }
    for (const char c : json->at("detected").get<std::string>()) table.detected.push_back(static_cast<char>(c == '1'));
    table.Check();
    return table;
  }
  const Scenario& scenario = *world.scenario;
  table =
      session::MakeOutcomeTable(*scenario.world, scenario.starts.front(), params, *scenario.judge, 1.05, [&](int done, int all) {
        if (done % 10 == 0) std::cout << "outcomes of " << world.name << ": " << done << " of " << all << '\n' << std::flush;
      });
  Json json;
  json["settings"] = settings;
  json["viewpoints"] = Json::array();
  for (const measures::Viewpoint& view : table.viewpoints) {
    json["viewpoints"].push_back({view.direction.x(), view.direction.y(), view.direction.z(), view.distance_m});
  }
  std::string detected;
  for (const char outcome : table.detected) detected += outcome != 0 ? '1' : '0';
  json["detected"] = detected;
  WriteWhole(file, json.dump(1) + "\n");
  return table;
}

// `options` and `params` must outlive the worlds.
std::vector<World> WorldsOf(const ExploreOptions& options, const params::LibraryParams& params) {
  std::vector<World> worlds;
  const auto add = [&](const std::string& name, std::function<Scenario()> make) {
    worlds.push_back({name, std::move(make), std::nullopt, {}});
  };
  for (const std::string& mesh : options.meshes) {
    if (!options.sequence.empty()) break;  // Then it is the surface to judge by.
    add(WorldName(mesh), [&, mesh] { return SimulatedScenario("", {mesh}, "", options.judge_views, params, 0, true); });
  }
  if (!options.sequence.empty()) {
    const std::string mesh = options.meshes.empty() ? "" : options.meshes.front();
    add(WorldName(options.sequence), [&, mesh] { return RecordedScenario(options.sequence, options.object_id, mesh, params); });
  }
  if (!options.world.empty()) {
    add(WorldName(options.world),
        [&] { return SimulatedScenario(options.world, {}, options.object, options.judge_views, params, 0, true); });
  }
  return worlds;
}

}  // namespace

void Compare(const ExploreOptions& given) {
  ExploreOptions options = given;
  const fs::path folder = options.compare;
  std::error_code failed;
  fs::create_directories(folder, failed);
  if (failed) throw std::runtime_error(folder.string() + ": cannot be made: " + failed.message());
  CheckOutput(options.common);
  params::LibraryParams params = LoadParams(options.common);
  if (options.quick) {
    MakeQuick(params);
    options.judge_views = std::min(options.judge_views, 6);
  }
  if (options.strategies.empty()) options.strategies = exploration::StrategyNames();
  const std::string settings = SettingsOf(options, params);
  std::vector<World> worlds = WorldsOf(options, params);

  std::vector<Json> runs;
  for (int i = 0; i < options.runs; ++i) {
    const std::uint32_t seed = options.common.seed + static_cast<std::uint32_t>(i);
    for (World& world : worlds) {
      for (const std::string& strategy : options.strategies) {
        const fs::path file = folder / ("run-" + world.name + "-" + strategy + "-" + std::to_string(seed) + ".json");
        if (const auto kept = ReadOwn(file, settings)) {
          runs.push_back(*kept);
          continue;
        }
        options.strategy = strategy;
        if (!world.scenario) world.scenario = world.make();
        session::ExploreParams explore = ParamsOf(options, params, *world.scenario, seed);
        explore.judge_over_time = true;
        if (strategy == "oracle") {
          if (world.outcomes.viewpoints.empty()) {
            world.outcomes = OutcomesOf(world, explore, folder / ("outcomes-" + world.name + ".json"), settings);
          }
          explore.outcomes = &world.outcomes;
        }
        const session::ExploreResult result = RunOnce(*world.scenario, explore, "", nullptr, {});
        Json run = ToJson(result);
        run["world"] = world.name;
        run["settings"] = settings;
        WriteWhole(file, run.dump(1) + "\n");
        runs.push_back(run);
        std::cout << world.name << ": " << SummaryOf(result) << std::flush;
      }
    }
  }
  const CompareFigures figures = FiguresOf(runs, options.strategies);
  WriteWhole(folder / "compare.json", figures.figures.dump(1) + "\n");
  WriteWhole(folder / "table.txt", figures.table);
  PlotRuns(runs, options.strategies, folder);
  WriteResult(options.common, figures.figures, figures.table);
}

}  // namespace vantage::cli
