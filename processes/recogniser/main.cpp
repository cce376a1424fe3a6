#include "common/process_main.h"
#include "recogniser/node.h"

int main(int argc, char** argv) {
  std::string library;
  std::string store;
  vantage::processes::ProcessDescription process;
  process.name = "recogniser";
  process.purpose = "Finds every object of the store in the newest frame, with pose and p(o|c)";
  process.add_options = [&](CLI::App& app) {
    app.add_option("--library", library, "YAML file with the library's parameters, as config/library.yaml");
    app.add_option("--store", store, "model store to read (SQLite); it may appear later");
  };
  process.make_node = [&](vantage::messaging::Bus& bus, const std::string& config_file) {
    auto params = vantage::recogniser::LoadRecogniserNodeParams(config_file, library);
    if (!store.empty()) params.store = store;
    return std::make_unique<vantage::recogniser::RecogniserNode>(bus, params);
  };
  return vantage::processes::RunProcess(argc, argv, process);
}
