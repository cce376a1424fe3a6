// vantage evaluate features: which features recognise best, and at what cost.
#include <CLI/CLI.hpp>
#include <cstdio>

#include "vantage/feature_trial.h"
#include "vantage/sequence.h"
#include "vantage/verb.h"

namespace vantage::cli {
namespace {

struct FeaturesOptions {
  CommonOptions common;
  std::string sequence;
  int object_id = 0;
  std::string frames = "even";
  int folds = 2;
  std::vector<std::string> settings = {"sift:2000:0.02", "sift:2000:0.04", "sift:3000:0.02", "sift:3000:0.04",
                                       "surf:3000:0.02", "surf:3000:0.01", "surf:6000:0.005"};
  bool quick = false;
};

Json ToJson(const FeatureSetting& setting, const FeatureFigures& figures) {
  Json result;
  result["features"] = setting.name;
  result["frames"] = figures.frames;
  result["found"] = figures.found;
  result["found_10mm"] = figures.found_10mm;
  result["right"] = figures.right;
  result["right_10mm"] = figures.right_10mm;
  result["wrong"] = figures.wrong;
  result["views"] = figures.views;
  result["view_points"] = figures.view_points;
  if (!figures.coded_kb.empty()) result["coded_kb_median"] = Quantile(figures.coded_kb, 0.5);
  result["points_median"] = Number(Quantile(figures.points, 0.5));
  result["extract_ms_median"] = Number(Quantile(figures.extract_ms, 0.5));
  result["whole_ms_median"] = Number(Quantile(figures.whole_ms, 0.5));
  result["extract_processor_ms_median"] = Number(Quantile(figures.extract_cpu_ms, 0.5));
  result["whole_processor_ms_median"] = Number(Quantile(figures.whole_cpu_ms, 0.5));
  return result;
}

std::string RowOf(const FeatureSetting& setting, const FeatureFigures& figures) {
  char line[220];
  char coded[30] = "";
  if (!figures.coded_kb.empty()) std::snprintf(coded, sizeof coded, "  %.0f KB", Quantile(figures.coded_kb, 0.5));
  std::snprintf(line, sizeof line, "%-22s %6d %6d %6d %6d %6d %6d %7.0f %8.0f %8.0f %8.0f %8.0f%s\n", setting.name.c_str(),
                figures.frames, figures.found, figures.found_10mm, figures.right, figures.right_10mm, figures.wrong,
                Quantile(figures.points, 0.5), Quantile(figures.extract_ms, 0.5), Quantile(figures.whole_ms, 0.5),
                Quantile(figures.extract_cpu_ms, 0.5), Quantile(figures.whole_cpu_ms, 0.5), coded);
  return line;
}

void RunEvaluateFeatures(const FeaturesOptions& options) {
  CheckOutput(options.common);
  const params::LibraryParams params = LoadParams(options.common);
  std::vector<FeatureSetting> settings;
  for (const std::string& text : options.settings) settings.push_back(ParseFeatureSetting(text));
  const rgbd::BopScene scene(options.sequence);
  std::vector<int> ids = FramesOf(scene, options.frames);
  constexpr std::size_t kQuickFrames = 8;
  if (options.quick && ids.size() > kQuickFrames) ids.resize(kQuickFrames);
  if (static_cast<int>(ids.size()) < options.folds) {
    throw std::runtime_error(options.sequence + ": --folds " + std::to_string(options.folds) + " needs as many frames, found " +
                             std::to_string(ids.size()));
  }
  const auto figures = TryFeatures(scene, ids, options.object_id, options.folds, settings, params.recogniser);
  Json result;
  result["seed"] = options.common.seed;
  result["folds"] = options.folds;
  result["settings"] = Json::array();
  std::string summary =
      "features               frames  found  10 mm  right  10 mm  wrong  points  extract    whole extract*   whole*   (ms a frame; "
      "* processor)\n";
  for (std::size_t i = 0; i < settings.size(); ++i) {
    result["settings"].push_back(ToJson(settings[i], figures[i]));
    summary += RowOf(settings[i], figures[i]);
  }
  WriteResult(options.common, result, summary);
}

}  // namespace

void AddEvaluateFeatures(CLI::App& evaluate, Run& run) {
  auto options = std::make_shared<FeaturesOptions>();
  CLI::App* verb =
      evaluate.add_subcommand("features", "Features held against each other by cross-validation on a recording with known poses");
  AddCommonOptions(*verb, options->common);
  verb->add_option("--sequence", options->sequence, "BOP scene folder with depth, labels and truth of the object")
      ->required()
      ->type_name("DIR");
  verb->add_option("--object-id", options->object_id, "The object of scene_gt.json that is learned and looked for")
      ->required()
      ->check(CLI::Range(1, 1000000))
      ->type_name("N");
  verb->add_option("--frames", options->frames, "Which frames: all, even, odd (by id), or ids A:B without B")
      ->capture_default_str();
  verb->add_option("--folds", options->folds, "Each is asked about what was learned from the others")
      ->check(CLI::Range(2, 1000))
      ->capture_default_str();
  verb->add_option("--features", options->settings, "What is compared, parted by commas")
      ->delimiter(',')
      ->capture_default_str()
      ->type_name("TYPE:MAX_KEYPOINTS:CONTRAST[:JPEG_QUALITY][,...]");
  verb->add_flag("--quick", options->quick, "The first 8 frames only");
  verb->callback([options, &run] { run = [options] { RunEvaluateFeatures(*options); }; });
}

}  // namespace vantage::cli
