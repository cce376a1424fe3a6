// vantage VERB: the library without the bus, offline.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <string>

#include "features/memory.h"
#include "vantage/verb.h"

namespace {

// One line on standard error, whatever the message holds.
int Fail(const std::string& who, std::string message) {
  while (!message.empty() && message.back() == '\n') message.pop_back();
  for (char& c : message) {
    if (c == '\n') c = ' ';
  }
  std::fprintf(stderr, "%s: %s\n", who.c_str(), message.c_str());
  return 1;
}

// "vantage learn", "vantage models show": as far as the words given are verbs.
std::string VerbName(const CLI::App& app) {
  std::string name = app.get_name();
  for (const CLI::App* verb : app.get_subcommands()) name += " " + VerbName(*verb);
  return name;
}

// The first word where a verb is due that is none; empty where there is no such word.
std::string UnknownVerb(const CLI::App& app, int argc, char** argv) {
  const CLI::App* verb = &app;
  for (int i = 1; i < argc && argv[i][0] != '-' && verb->get_require_subcommand_min() > 0; ++i) {
    std::string word = argv[i];
    const auto named = verb->get_subcommands([&](const CLI::App* candidate) { return candidate->get_name() == word; });
    if (named.empty()) return word;
    verb = named.front();
  }
  return "";
}

}  // namespace

int main(int argc, char** argv) {
  vantage::features::KeepFreedMemory();
  CLI::App app("Learns objects from RGB-D recordings, recognises them, and knows how sure it is.", "vantage");
  app.set_version_flag("--version", "vantage " VANTAGE_VERSION);
  app.require_subcommand(1);
  vantage::cli::Run run;
  vantage::cli::AddLearn(app, run);
  vantage::cli::AddRecognise(app, run);
  vantage::cli::AddAssess(app, run);
  vantage::cli::AddExplore(app, run);
  vantage::cli::AddModels(app, run);
  vantage::cli::AddEvaluate(app, run);
  vantage::cli::AddVocabulary(app, run);
  vantage::cli::AddLog(app, run);
  vantage::cli::AddReplay(app, run);
  vantage::cli::AddCalibrate(app, run);
  vantage::cli::AddTruth(app, run);
  if (const std::string word = UnknownVerb(app, argc, argv); !word.empty()) {
    return Fail("vantage", "there is no verb '" + word + "'; see vantage --help");
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& asked) {
    return app.exit(asked);  // --help, --version
  } catch (const CLI::ParseError& error) {
    const std::string who = VerbName(app);
    return Fail(who, std::string(error.what()) + "; see " + who + " --help");
  }
  try {
    run();
  } catch (const std::exception& error) {
    return Fail(VerbName(app), error.what());
  }
  return 0;
}
