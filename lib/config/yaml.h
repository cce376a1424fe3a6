// Strict YAML: keys are the names of struct fields; unknown keys, wrong types and broken syntax are errors that name file and line.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace vantage::config {

// One mapping of a YAML file. Get leaves a value as it is where the key is absent. Once everything known was asked for, Finish
// refuses what is left. Every error is a std::runtime_error "FILE:LINE: what was expected, what was found".
class Mapping {
 public:
  // Throws std::runtime_error: no such file, broken YAML, not a mapping. An empty file is an empty mapping.
  static Mapping Load(const std::filesystem::path& file);
  static Mapping Parse(const std::string& text, const std::string& name);

  bool Has(const std::string& key) const;
  void Get(const std::string& key, bool& value);
  void Get(const std::string& key, int& value);
  void Get(const std::string& key, std::uint32_t& value);
  void Get(const std::string& key, double& value);  // Finite.
  void Get(const std::string& key, std::string& value);
  void Get(const std::string& key, Eigen::Vector3d& value);  // [x, y, z]
  void Get(const std::string& key, std::vector<double>& value);
  void Get(const std::string& key, std::vector<std::string>& value);

  Mapping Child(const std::string& key);                  // Empty mapping where the key is absent.
  std::vector<Mapping> Children(const std::string& key);  // A list of mappings; empty where absent.

  // Throws where a key was never asked for, naming it, its line and the known keys. Children check themselves.
  void Finish() const;
  // Throws "FILE:LINE: key: message" for a value that was read but is out of range.
  [[noreturn]] void Fail(const std::string& key, const std::string& message) const;
  // Runs params.Check() and turns its std::invalid_argument into an error that names this file.
  template <typename Params>
  void Check(const Params& params) const {
    try {
      params.Check();
    } catch (const std::invalid_argument& error) {
      Fail("", error.what());
    }
  }

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace vantage::config
