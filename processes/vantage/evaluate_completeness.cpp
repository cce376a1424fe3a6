// vantage evaluate completeness: how the views' probabilities combine, measured on photographs.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <iostream>

#include "vantage/completeness_trial.h"

namespace vantage::cli {
namespace {

struct Options {
  CommonOptions common;
  CompletenessOptions trial;
  bool quick = false;
};

void RunEvaluateCompleteness(const Options& options) {
  CheckOutput(options.common);
  const params::LibraryParams params = LoadParams(options.common);
  CompletenessOptions trial = options.trial;
  trial.seed = options.common.seed;
  if (options.quick) trial.splits = 6;
  const auto figures = TryCompleteness(trial, params, [](int done, int of) {
    std::cerr << "\r" << done << " of " << of << " splits" << (done == of ? "\n" : "") << std::flush;
  });
  const double pooled = PooledCommonCause(figures);
  char line[100];
  std::snprintf(line, sizeof line, "common cause of all looks of several views together: %.2f\n", pooled);
  WriteResult(options.common,
              {{"splits", trial.splits}, {"seed", trial.seed}, {"views", ToJson(figures)}, {"common_cause_pooled", pooled}},
              TableOf(figures) + line);
}

}  // namespace

void AddEvaluateCompleteness(CLI::App& evaluate, Run& run) {
  auto options = std::make_shared<Options>();
  CLI::App* verb = evaluate.add_subcommand(
      "completeness", "How the probabilities of several views combine: each rule's prediction beside the share of frames detected");
  AddCommonOptions(*verb, options->common);
  verb->add_option("--sequence", options->trial.folder, "BOP scene folder with depth, labels and truth")
      ->required()
      ->type_name("DIR");
  verb->add_option("--object-id", options->trial.object_id, "The object of scene_gt.json")
      ->required()
      ->check(CLI::Range(1, 1000000))
      ->type_name("N");
  verb->add_option("--frames", options->trial.frames, "Of these frames: all, even, odd (by id), or ids A:B without B")
      ->capture_default_str();
  verb->add_option("--views", options->trial.views, "Views of the models")
      ->delimiter(',')
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  verb->add_option("--splits", options->trial.splits, "Random splits of the frames in three: to learn from, to fit on, to judge")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  verb->add_flag("--quick", options->quick, "6 splits");
  verb->callback([options, &run] { run = [options] { RunEvaluateCompleteness(*options); }; });
}

}  // namespace vantage::cli
