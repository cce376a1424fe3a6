// What the main functions of all processes share: options, errors in one line, run until a signal.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <string>

#include "messaging/node.h"

namespace vantage::processes {

struct ProcessDescription {
  std::string name;     // Lower case.
  std::string purpose;  // One line, for --help.
  // Adds the process's own options; may be empty.
  std::function<void(CLI::App&)> add_options;
  // Reads the configuration and makes the node. Anything it throws ends the process with one line and exit code 1.
  std::function<std::unique_ptr<messaging::Node>(messaging::Bus& bus, const std::string& config_file)> make_node;
};

// Returns the exit code: 0 after SIGINT, SIGTERM or a node that is finished, 1 on errors. Every process knows --url, --config,
// --version and --help.
int RunProcess(int argc, char** argv, const ProcessDescription& process);

}  // namespace vantage::processes
