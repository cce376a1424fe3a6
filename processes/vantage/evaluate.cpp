// vantage evaluate: the figures by which the parts are judged.
#include <CLI/CLI.hpp>

#include "vantage/verb.h"

namespace vantage::cli {

void AddEvaluate(CLI::App& app, Run& run) {
  CLI::App* verb = app.add_subcommand("evaluate", "Hold a part of the system against the truth");
  verb->require_subcommand(1);
  verb->set_version_flag("--version", "vantage " VANTAGE_VERSION);
  AddEvaluateCalibration(*verb, run);
  AddEvaluateCompleteness(*verb, run);
  AddEvaluateFeatures(*verb, run);
  AddEvaluateLearner(*verb, run);
  AddEvaluateRecogniser(*verb, run);
  AddEvaluateSegmentation(*verb, run);
  AddEvaluateUpdate(*verb, run);
}

}  // namespace vantage::cli
