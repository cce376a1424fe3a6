// What the verbs of the command line share: common options, and results that are written whole or not at all.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/params.h"
#include "geometry/rigid.h"

namespace CLI {
class App;
}

namespace vantage::cli {

using Json = nlohmann::ordered_json;

struct CommonOptions {
  std::uint32_t seed = 0;
  std::string json;    // Where the result goes as JSON: a file, "-" = standard output, empty = nowhere.
  std::string config;  // YAML with library parameters; empty = the defaults.
};

// Adds a verb's own options to `app` and sets `run` when the verb was chosen. What it throws becomes the one line of the error.
using Run = std::function<void()>;
void AddLearn(CLI::App& app, Run& run);
void AddRecognise(CLI::App& app, Run& run);
void AddAssess(CLI::App& app, Run& run);
void AddExplore(CLI::App& app, Run& run);
void AddModels(CLI::App& app, Run& run);
void AddEvaluate(CLI::App& app, Run& run);
// The parts of `evaluate`.
void AddEvaluateCalibration(CLI::App& evaluate, Run& run);
void AddEvaluateCompleteness(CLI::App& evaluate, Run& run);
void AddEvaluateFeatures(CLI::App& evaluate, Run& run);
void AddEvaluateLearner(CLI::App& evaluate, Run& run);
void AddEvaluateRecogniser(CLI::App& evaluate, Run& run);
void AddEvaluateSegmentation(CLI::App& evaluate, Run& run);
void AddEvaluateUpdate(CLI::App& evaluate, Run& run);
void AddCalibrate(CLI::App& app, Run& run);
void AddTruth(CLI::App& app, Run& run);
void AddVocabulary(CLI::App& app, Run& run);
void AddLog(CLI::App& app, Run& run);
void AddReplay(CLI::App& app, Run& run);

// --seed, --json, --config and --version.
void AddCommonOptions(CLI::App& verb, CommonOptions& options);

// The parameters of --config, with --seed in all of them. Throws std::runtime_error naming file and line.
params::LibraryParams LoadParams(const CommonOptions& options);

// Throws std::runtime_error where a file could not be written there, before hours of work went into it.
void CheckWritable(const std::filesystem::path& file);

// Writes under another name, then renames: the file is whole or as it was.
void WriteWhole(const std::filesystem::path& file, const std::string& text);

// Runs `file`, a gnuplot script, in its folder; nothing where that program is not found. What gnuplot complains of stays in
// gnuplot.log beside it.
void RunGnuplot(const std::filesystem::path& file);

// Checks that --json can be written; called before the work.
void CheckOutput(const CommonOptions& options);

// The result as JSON where it was asked for; `summary` for people on standard output, unless the JSON goes there.
void WriteResult(const CommonOptions& options, const Json& result, const std::string& summary);

// 16 numbers, row-major.
Json ToJson(const geometry::Rigid& transform);

// A number, or null where it is not finite.
Json Number(double value);

// By linear interpolation between the sorted values, share in [0, 1]; NaN without values.
double Quantile(std::vector<double> values, double share);

}  // namespace vantage::cli
