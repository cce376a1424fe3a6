#include <stdexcept>

#include "common/process_main.h"
#include "sensor/node.h"
#include "simulation/simulated_world.h"

namespace {

struct Options {
  std::string sequence;
  std::string oni;
  std::string world;
  std::string frames = "all";
  bool loop = false;
  std::uint32_t seed = 0;
};

std::unique_ptr<vantage::sensor::FrameSource> MakeSource(const Options& options) {
  const int given = !options.sequence.empty() + !options.oni.empty() + !options.world.empty();
  if (given != 1) throw std::runtime_error("say where frames come from: one of --sequence DIR, --oni FILE, --world FILE");
  if (!options.sequence.empty()) return vantage::sensor::MakeRecordingSource(options.sequence, options.frames, options.loop);
  if (!options.oni.empty()) return vantage::sensor::MakeOpenNiSource(options.oni == "any" ? "" : options.oni, options.loop);
  const auto params = vantage::simulation::LoadWorldParams(options.world);
  return vantage::sensor::MakeWorldSource(std::make_shared<vantage::simulation::SimulatedWorld>(params), options.seed);
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  vantage::processes::ProcessDescription process;
  process.name = "sensor";
  process.purpose = "RGB-D frames from a recording, an OpenNI2 device or file, or a simulated world";
  process.add_options = [&](CLI::App& app) {
    app.add_option("--sequence", options.sequence, "BOP scene folder to play");
    app.add_option("--frames", options.frames, "of the sequence: all, even, odd or A:B");
    app.add_flag("--loop", options.loop, "start the sequence or file again at its end");
    app.add_option("--oni", options.oni, "OpenNI2 recording (.oni), or 'any' for the first camera");
    app.add_option("--world", options.world, "YAML file of a simulated world; the camera follows MOUNT_STATE");
    app.add_option("--seed", options.seed, "of the simulated noise");
  };
  process.make_node = [&](vantage::messaging::Bus& bus, const std::string& config_file) {
    const auto params = vantage::sensor::LoadSensorNodeParams(config_file);
    return std::make_unique<vantage::sensor::SensorNode>(bus, MakeSource(options), params);
  };
  return vantage::processes::RunProcess(argc, argv, process);
}
