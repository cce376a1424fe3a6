#include "vantage/verb.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <limits>

namespace vantage::cli {

namespace fs = std::filesystem;

void AddCommonOptions(CLI::App& verb, CommonOptions& options) {
  verb.add_option("--seed", options.seed, "Seed of all randomness: the same seed and input give the same result")
      ->capture_default_str();
  verb.add_option("--json", options.json, "Write the result as JSON to this file, or - for standard output")->type_name("FILE|-");
  verb.add_option("--config", options.config, "YAML with library parameters, as config/library.yaml")->type_name("FILE");
  verb.set_version_flag("--version", "vantage " VANTAGE_VERSION);
}

params::LibraryParams LoadParams(const CommonOptions& options) {
  params::LibraryParams params;
  if (!options.config.empty()) params = params::LoadLibraryParams(options.config);
  params.recogniser.seed = options.seed;
  params.learner.recogniser.seed = options.seed;
  params.trials.seed = options.seed;
  return params;
}

void CheckWritable(const fs::path& file) {
  std::error_code ignored;
  if (fs::is_directory(file, ignored)) throw std::runtime_error(file.string() + ": is a folder; give the path of a file");
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  if (!fs::is_directory(folder, ignored)) {
    throw std::runtime_error(file.string() + ": no folder " + folder.string() + "; create it first");
  }
  if (::access(folder.c_str(), W_OK) != 0) {
    throw std::runtime_error(file.string() + ": cannot write in " + folder.string() + "; check its permissions");
  }
}

void WriteWhole(const fs::path& file, const std::string& text) {
  fs::path temporary = file;
  temporary += ".new-" + std::to_string(::getpid());
  std::error_code ignored;
  {
    std::ofstream stream(temporary, std::ios::binary);
    stream << text;
    stream.close();
    if (!stream) {
      fs::remove(temporary, ignored);
      throw std::runtime_error(file.string() + ": cannot be written; check the folder and the space on its disk");
    }
  }
  std::error_code failed;
  fs::rename(temporary, file, failed);
  if (failed) {
    fs::remove(temporary, ignored);
    throw std::runtime_error(file.string() + ": cannot be replaced: " + failed.message());
  }
}

void RunGnuplot(const fs::path& file) {
  const auto quoted = [](std::string text) {
    for (std::size_t at = 0; (at = text.find('\'', at)) != std::string::npos; at += 4) text.replace(at, 1, "'\\''");
    return "'" + text + "'";
  };
  const std::string command = "cd " + quoted(file.parent_path().string()) + " && command -v gnuplot >/dev/null && gnuplot " +
                              quoted(file.filename().string()) + " 2>gnuplot.log && rm -f gnuplot.log";
  // Without the program the tables and the script are there all the same.
  [[maybe_unused]] const int status = std::system(command.c_str());
}

void CheckOutput(const CommonOptions& options) {
  if (!options.json.empty() && options.json != "-") CheckWritable(options.json);
}

void WriteResult(const CommonOptions& options, const Json& result, const std::string& summary) {
  // What JSON cannot hold (a name that is no UTF-8) is replaced, never a reason to lose the result.
  const std::string text = result.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
  if (options.json == "-") {
    std::cout << text << std::flush;
    if (!std::cout) throw std::runtime_error("cannot write to standard output");
    return;
  }
  if (!options.json.empty()) WriteWhole(options.json, text);
  std::cout << summary << std::flush;
}

Json ToJson(const geometry::Rigid& transform) {
  Json numbers = Json::array();
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) numbers.push_back(transform(row, column));
  }
  return numbers;
}

Json Number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

double Quantile(std::vector<double> values, double share) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(values.begin(), values.end());
  const double at = share * static_cast<double>(values.size() - 1);
  const std::size_t below = static_cast<std::size_t>(at);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  return values[below] + (at - static_cast<double>(below)) * (values[above] - values[below]);
}

}  // namespace vantage::cli
