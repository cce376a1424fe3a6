#include "common/process_main.h"
#include "mount/node.h"
#include "simulation/simulated_world.h"

int main(int argc, char** argv) {
  std::string world;
  std::string library;
  vantage::processes::ProcessDescription process;
  process.name = "mount";
  process.purpose = "Simulated mount: carries the camera along trajectories, within its speed limits";
  process.add_options = [&](CLI::App& app) {
    app.add_option("--library", library, "YAML file with the library's parameters, as config/library.yaml: which mount it is");
    app.add_option("--world", world, "YAML file of the simulated world to start in, at its start pose");
  };
  process.make_node = [&](vantage::messaging::Bus& bus, const std::string& config_file) {
    auto params = vantage::mount::LoadMountParams(config_file, library);
    if (!world.empty()) {
      const auto world_params = vantage::simulation::LoadWorldParams(world);
      params.start_eye_m = world_params.start_eye_m;
      params.start_target_m = world_params.start_target_m;
    }
    return std::make_unique<vantage::mount::MountNode>(bus, params);
  };
  return vantage::processes::RunProcess(argc, argv, process);
}
