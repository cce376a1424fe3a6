#include "common/process_main.h"
#include "planner/node.h"

int main(int argc, char** argv) {
  std::string library;
  std::string summary;
  bool exit_when_done = false;
  vantage::processes::ProcessDescription process;
  process.name = "planner";
  process.purpose = "Decides where to look next, sends the mount there, and knows when to stop";
  process.add_options = [&](CLI::App& app) {
    app.add_option("--library", library, "YAML file with the library's parameters, as config/library.yaml");
    app.add_option("--summary", summary, "JSON file to write when the run is over");
    app.add_flag("--exit-when-done", exit_when_done, "end with the run");
  };
  process.make_node = [&](vantage::messaging::Bus& bus, const std::string& config_file) {
    auto params = vantage::planner::LoadPlannerNodeParams(config_file, library);
    if (!summary.empty()) params.summary = summary;
    params.exit_when_done |= exit_when_done;
    return std::make_unique<vantage::planner::PlannerNode>(bus, params);
  };
  return vantage::processes::RunProcess(argc, argv, process);
}
