#include "common/process_main.h"
#include "mount/node.h"

int main(int argc, char** argv) {
  vantage::processes::ProcessDescription process;
  process.name = "mount";
  process.purpose = "Simulated mount: carries the camera along trajectories, within its speed limits";
  process.make_node = [](vantage::messaging::Bus& bus, const std::string& config_file) {
    return std::make_unique<vantage::mount::MountNode>(bus, vantage::mount::LoadMountParams(config_file));
  };
  return vantage::processes::RunProcess(argc, argv, process);
}
