#include "common/process_main.h"
#include "learner/node.h"

int main(int argc, char** argv) {
  std::string library;
  std::string store;
  std::string object;
  vantage::processes::ProcessDescription process;
  process.name = "learner";
  process.purpose = "Learns an object online from SENSOR_COLOR and SENSOR_DEPTH and keeps it in the store";
  process.add_options = [&](CLI::App& app) {
    app.add_option("--library", library, "YAML file with the library's parameters, as config/library.yaml");
    app.add_option("--store", store, "model store to write (SQLite); made where there is none");
    app.add_option("--object", object, "name of the object; one that is in the store is learned further");
  };
  process.make_node = [&](vantage::messaging::Bus& bus, const std::string& config_file) {
    auto params = vantage::learner::LoadLearnerNodeParams(config_file, library);
    if (!store.empty()) params.store = store;
    if (!object.empty()) params.object = object;
    return std::make_unique<vantage::learner::LearnerNode>(bus, params);
  };
  return vantage::processes::RunProcess(argc, argv, process);
}
