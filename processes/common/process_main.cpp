#include "common/process_main.h"

#include <cstdio>
#include <exception>

#include "features/memory.h"
#include "messaging/run_loop.h"

namespace vantage::processes {

int RunProcess(int argc, char** argv, const ProcessDescription& process) {
  features::KeepFreedMemory();
  std::setvbuf(stdout, nullptr, _IOLBF, 0);  // Logs are read while we run.
  CLI::App app(process.purpose, process.name);
  std::string url;
  std::string config_file;
  app.add_option("--url", url, std::string("LCM URL; default $LCM_DEFAULT_URL, else ") + messaging::kDefaultUrl);
  app.add_option("--config", config_file, "YAML file with the parameters (config/" + process.name + ".yaml shows all of them)");
  app.set_version_flag("--version", VANTAGE_VERSION);
  if (process.add_options) process.add_options(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    std::fprintf(stderr, "%s: %s (see --help)\n", process.name.c_str(), error.what());
    return 1;
  }
  try {
    const messaging::StopSignals signals;
    messaging::Bus bus(url);
    const auto node = process.make_node(bus, config_file);
    messaging::RunNodes(bus, {node.get()}, &signals);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", process.name.c_str(), error.what());
    return 1;
  }
}

}  // namespace vantage::processes
