#include "common/process_main.h"
#include "link/node.h"

int main(int argc, char** argv) {
  std::string host, offer, copy;
  vantage::processes::ProcessDescription process;
  process.name = "link";
  process.purpose = "Measures the other hosts' clocks, and copies the model store between hosts";
  process.add_options = [&](CLI::App& app) {
    app.add_option("--host", host, "this machine's name");
    app.add_option("--offer", offer, "the model store that is on this host");
    app.add_option("--copy", copy, "file that the store of another host is copied to");
  };
  process.make_node = [&](vantage::messaging::Bus& bus, const std::string& config_file) {
    auto params = vantage::link::LoadLinkParams(config_file);
    if (!host.empty()) params.host = host;
    if (!offer.empty()) params.offer = offer;
    if (!copy.empty()) params.copy = copy;
    return std::make_unique<vantage::link::LinkNode>(bus, params);
  };
  return vantage::processes::RunProcess(argc, argv, process);
}
