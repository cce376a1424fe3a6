#include "assessor/node.h"
#include "common/process_main.h"

int main(int argc, char** argv) {
  std::string library;
  std::string store;
  vantage::processes::ProcessDescription process;
  process.name = "assessor";
  process.purpose = "Learns the measures of objects from virtual views, and how completely they are known";
  process.add_options = [&](CLI::App& app) {
    app.add_option("--library", library, "YAML file with the library's parameters, as config/library.yaml");
    app.add_option("--store", store, "model store to read (SQLite); it may appear later");
  };
  process.make_node = [&](vantage::messaging::Bus& bus, const std::string& config_file) {
    auto params = vantage::assessor::LoadAssessorNodeParams(config_file, library);
    if (!store.empty()) params.store = store;
    return std::make_unique<vantage::assessor::AssessorNode>(bus, params);
  };
  return vantage::processes::RunProcess(argc, argv, process);
}
