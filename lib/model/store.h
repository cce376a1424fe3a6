// The model store: one SQLite file. One writer (the learner), any number of readers, also from other processes.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "model/object_model.h"

namespace vantage::model {

// Not for several threads at once: every thread opens its own.
class Store {
 public:
  enum class Mode { kRead, kWrite };  // kWrite creates the file where there is none.

  struct Summary {
    std::string name;
    int views = 0;
    int points = 0;
    std::int64_t revision = 0;  // Rises with every change to the object.
    std::int64_t utime = 0;     // Capture time of the newest view.
  };

  // Throws std::runtime_error naming the file and what to do: no such file (kRead), not SQLite, not a Vantage store, a newer
  // schema.
  Store(const std::filesystem::path& file, Mode mode);
  ~Store();
  Store(Store&&) noexcept;
  Store& operator=(Store&&) noexcept;

  std::vector<Summary> List() const;  // By name.
  // nullopt where there is no such object. Throws std::runtime_error where stored data is damaged, naming the object and view.
  std::optional<ObjectModel> Load(const std::string& name) const;

  // Every call is one transaction: durable when it returns (WAL, synchronous FULL), or nothing is changed. Throw std::runtime_error
  // (disk full, read-only, locked longer than 5 s).
  void SaveObject(const ObjectModel& model);  // Replaces the whole object, completeness included.
  // Brings what is stored to this state of the object, without writing images again: new views are added, those it has no more are
  // removed, poses, points, links and features of the others follow. Makes the object where there is none; measures stay as they
  // were saved. Throws std::invalid_argument where a view is stored under the same id with another time: that is another object.
  void Update(const ObjectModel& model);
  void SaveMeasures(const std::string& name, const measures::Measures& measures, double completeness);
  void Remove(const std::string& name);

  std::optional<double> Completeness(const std::string& name) const;  // As last saved with the measures.
  const std::filesystem::path& file() const { return file_; }

 private:
  struct Impl;
  std::filesystem::path file_;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vantage::model
