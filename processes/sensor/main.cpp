#include <cstdio>
#include <stdexcept>

#include "common/calibration_file.h"
#include "common/process_main.h"
#include "sensor/node.h"
#include "simulation/simulated_world.h"

namespace {

struct Options {
  std::string sequence;
  std::string oni;
  std::string world;
  std::string frames = "all";
  std::string mode;
  std::string calibration;
  std::string record;
  bool record_lossless = false;
  double max_silence_s = vantage::sensor::OpenNiOptions().max_silence_s;
  bool loop = false;
  std::uint32_t seed = 0;
};

// "WIDTHxHEIGHT", "@FPS" or both.
void ParseMode(const std::string& text, vantage::sensor::OpenNiOptions& options) {
  int used = 0;
  const int length = static_cast<int>(text.size());
  const char* mode = text.c_str();
  if (std::sscanf(mode, "%dx%d%n", &options.width, &options.height, &used) == 2 && used == length) return;
  if (std::sscanf(mode, "%dx%d@%d%n", &options.width, &options.height, &options.fps, &used) == 3 && used == length) return;
  options.width = options.height = 0;
  if (std::sscanf(mode, "@%d%n", &options.fps, &used) == 1 && used == length) return;
  throw std::runtime_error("--mode: expected WIDTHxHEIGHT, WIDTHxHEIGHT@HZ or @HZ, found '" + text + "'");
}

std::unique_ptr<vantage::sensor::FrameSource> MakeOpenNi(const Options& options) {
  vantage::sensor::OpenNiOptions openni;
  openni.uri = options.oni == "any" ? "" : options.oni;
  openni.loop = options.loop;
  if (!options.mode.empty()) ParseMode(options.mode, openni);
  if (!options.calibration.empty()) openni.calibration = vantage::processes::LoadCalibration(options.calibration).calibration;
  openni.record = options.record;
  openni.record_lossless = options.record_lossless;
  openni.max_silence_s = options.max_silence_s;
  return vantage::sensor::MakeOpenNiSource(openni);
}

std::unique_ptr<vantage::sensor::FrameSource> MakeSource(const Options& options) {
  const int given = !options.sequence.empty() + !options.oni.empty() + !options.world.empty();
  if (given != 1) throw std::runtime_error("say where frames come from: one of --sequence DIR, --oni FILE, --world FILE");
  if (options.oni.empty() && !(options.record + options.mode + options.calibration).empty()) {
    throw std::runtime_error(
        "--record, --mode and --calibration are of OpenNI2 devices (--oni); scripts/record keeps any source in a log");
  }
  if (!options.sequence.empty()) return vantage::sensor::MakeRecordingSource(options.sequence, options.frames, options.loop);
  if (!options.oni.empty()) return MakeOpenNi(options);
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
    app.add_option("--mode", options.mode, "of the OpenNI2 device: WIDTHxHEIGHT, WIDTHxHEIGHT@HZ or @HZ");
    app.add_option("--calibration", options.calibration, "intrinsics and distortion, a YAML file of vantage calibrate");
    app.add_option("--record", options.record, "record both streams of the OpenNI2 device in this new .oni file");
    app.add_flag("--record-lossless", options.record_lossless, "...with colour as it is, not as JPEG");
    app.add_option("--max-silence", options.max_silence_s, "seconds without a frame, then the OpenNI2 device is opened anew")
        ->check(CLI::Range(0.1, 3600.0));
    app.add_option("--world", options.world, "YAML file of a simulated world; the camera follows MOUNT_STATE");
    app.add_option("--seed", options.seed, "of the simulated noise");
  };
  process.make_node = [&](vantage::messaging::Bus& bus, const std::string& config_file) {
    const auto params = vantage::sensor::LoadSensorNodeParams(config_file);
    return std::make_unique<vantage::sensor::SensorNode>(bus, MakeSource(options), params);
  };
  return vantage::processes::RunProcess(argc, argv, process);
}
