// Virtual trials on disk, view by view: hours of them go on where they were stopped, and a model that grew needs its new views
// only.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "assessment/assessor.h"

namespace vantage::cli {

// One text file of JSON lines, one for each view. Lines that are cut off or broken, as a crash or a full disk leaves them, count as
// not there.
class TrialRecord {
 public:
  // `key` says what trials hold for (object, parameters, backgrounds); those of other keys stay in the file and are passed over.
  // Throws std::runtime_error where the file cannot be read or appended to.
  TrialRecord(std::filesystem::path file, std::string key);

  // The trials added last; null where there are none. `utime`: of the view; the same id at another time is another view.
  const std::vector<assessment::Trial>* Find(int view_id, std::int64_t utime) const;

  // On disk when it returns. Throws std::runtime_error where it cannot be written.
  void Add(int view_id, std::int64_t utime, const std::vector<assessment::Trial>& trials);

 private:
  std::filesystem::path file_;
  std::string key_;
  std::map<std::pair<int, std::int64_t>, std::vector<assessment::Trial>> trials_;
};

}  // namespace vantage::cli
