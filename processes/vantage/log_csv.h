// Messages as rows of tables: one CSV file for every channel.
#pragma once

#include <filesystem>
#include <fstream>
#include <map>
#include <string>

#include "messaging/log.h"

namespace vantage::cli {

class LogTables {
 public:
  // Makes the folder. Throws std::runtime_error where that is not possible.
  explicit LogTables(const std::filesystem::path& folder);

  // One row in CHANNEL.csv (for lists such as detections one row each, none where the list is empty). Channels that are not ours
  // and messages our nodes would refuse are left out: false.
  bool Add(const messaging::LogEvent& event);
  // Throws std::runtime_error where a file could not be written.
  void Finish();

  const std::map<std::string, std::int64_t>& rows() const { return rows_; }  // By channel.

 private:
  std::filesystem::path folder_;
  std::map<std::string, std::ofstream> files_;
  std::map<std::string, std::int64_t> rows_;
};

}  // namespace vantage::cli
