#include "model/store.h"

#include <sqlite3.h>

#include "measures/text.h"
#include "model/store_file.h"
#include "model/store_rows.h"

namespace vantage::model {

struct Store::Impl {
  // One connection serves one call at a time; SQLiteCpp wants it mutable even for reading.
  mutable SQLite::Database database;

  Impl(const std::filesystem::path& file, Mode mode)
      : database(mode == Mode::kRead ? ReaderUri(file) : file.string(),
                 SQLite::OPEN_READWRITE | (mode == Mode::kRead ? SQLite::OPEN_URI : 0), kBusyTimeoutMs) {
    if (mode == Mode::kRead) database.exec("PRAGMA query_only = ON");
  }

  void PrepareToWrite() {
    if (IsEmptyDatabase(database)) CreateSchema(database);
    database.exec("PRAGMA journal_mode = WAL");
    database.exec("PRAGMA synchronous = FULL");
    database.exec("PRAGMA foreign_keys = ON");
    // SQLite opens a file it may not write without a word; asking for the write lock tells.
    SQLite::Transaction(database, SQLite::TransactionBehavior::IMMEDIATE);
  }

  // Runs the changes as one transaction: all of them, or none where anything throws.
  template <typename Action>
  void Change(const std::filesystem::path& file, const Action& action) {
    Translated(file, [&] {
      SQLite::Transaction transaction(database, SQLite::TransactionBehavior::IMMEDIATE);
      action();
      transaction.commit();
    });
  }
};

Store::Store(const std::filesystem::path& file, Mode mode) : file_(file) {
  std::error_code ignored;
  if (std::filesystem::is_directory(file, ignored))
    throw std::runtime_error(file.string() + ": is a folder; give the path of a store");
  if (!std::filesystem::exists(file, ignored)) {
    if (mode == Mode::kRead) throw std::runtime_error(file.string() + ": no such store; learn an object into it first");
    Translated(file, [&] { CreateFile(file); });
  }
  Translated(file, [&] {
    impl_ = std::make_unique<Impl>(file, mode);
    // Nothing is written into a file before it is known to be ours (or empty).
    if (mode == Mode::kRead || !IsEmptyDatabase(impl_->database)) CheckIsOurs(impl_->database, file);
    if (mode == Mode::kWrite) impl_->PrepareToWrite();
  });
}

Store::~Store() = default;
Store::Store(Store&&) noexcept = default;
Store& Store::operator=(Store&&) noexcept = default;

std::vector<Store::Summary> Store::List() const {
  return Translated(file_, [&] {
    SQLite::Statement select(impl_->database,
                             "SELECT name, (SELECT count(*) FROM view WHERE object = object.id), point_count, revision, "
                             "coalesce((SELECT max(utime) FROM view WHERE object = object.id), 0) FROM object ORDER BY name");
    std::vector<Summary> summaries;
    while (select.executeStep()) {
      Summary summary;
      summary.name = select.getColumn(0).getString();
      summary.views = select.getColumn(1).getInt();
      summary.points = select.getColumn(2).getInt();
      summary.revision = select.getColumn(3).getInt64();
      summary.utime = select.getColumn(4).getInt64();
      summaries.push_back(std::move(summary));
    }
    return summaries;
  });
}

std::optional<ObjectModel> Store::Load(const std::string& name) const {
  return Translated(file_, [&]() -> std::optional<ObjectModel> {
    // One transaction, so that object and views are of one moment.
    SQLite::Transaction snapshot(impl_->database);
    SQLite::Statement select(impl_->database, "SELECT id, feature_fingerprint, measures, points FROM object WHERE name = ?");
    select.bind(1, name);
    if (!select.executeStep()) return std::nullopt;
    try {
      ObjectModel model;
      model.name = name;
      model.feature_fingerprint = select.getColumn(1).getString();
      model.measures = measures::MeasuresFromText(select.getColumn(2).getString());
      model.points = DecodePoints(ColumnBlob(select, 3));
      model.views = LoadViews(impl_->database, select.getColumn(0).getInt64(), static_cast<int>(model.points.size()));
      return model;
    } catch (const SQLite::Exception&) {
      throw;
    } catch (const std::exception& error) {
      throw std::runtime_error(file_.string() + ": object '" + name + "': " + error.what() + "; restore a copy or learn it again");
    }
  });
}

void Store::SaveObject(const ObjectModel& model) {
  impl_->Change(file_, [&] {
    RemoveObject(impl_->database, model.name);
    const std::int64_t object = WriteObject(impl_->database, model);
    for (const View& view : model.views) InsertView(impl_->database, object, model, view);
  });
}

void Store::Update(const ObjectModel& model) {
  impl_->Change(file_, [&] {
    const std::int64_t object = WriteObject(impl_->database, model);
    std::map<int, std::int64_t> stored = ViewTimes(impl_->database, object);
    for (const View& view : model.views) {
      const auto found = stored.find(view.id);
      if (found == stored.end()) {
        InsertView(impl_->database, object, model, view);
        continue;
      }
      if (found->second != view.utime) {
        throw std::invalid_argument("object '" + model.name + "', view " + std::to_string(view.id) +
                                    " is stored as a view of another time: this is another object; save it whole");
      }
      UpdateView(impl_->database, object, model, view);
      stored.erase(found);
    }
    for (const auto& [id, utime] : stored) RemoveView(impl_->database, object, id);
  });
}

void Store::SaveMeasures(const std::string& name, const measures::Measures& measures, double completeness) {
  impl_->Change(file_, [&] {
    SQLite::Statement update(impl_->database, "UPDATE object SET measures = ?, completeness = ?, revision = ? WHERE name = ?");
    update.bind(1, measures::ToText(measures));
    update.bind(2, completeness);
    update.bind(3, NextRevision(impl_->database));
    update.bind(4, name);
    if (update.exec() != 1) throw std::runtime_error(file_.string() + ": no object '" + name + "'");
  });
}

void Store::Remove(const std::string& name) {
  impl_->Change(file_, [&] {
    NextRevision(impl_->database);
    RemoveObject(impl_->database, name);
  });
}

std::optional<double> Store::Completeness(const std::string& name) const {
  return Translated(file_, [&]() -> std::optional<double> {
    SQLite::Statement select(impl_->database, "SELECT completeness FROM object WHERE name = ? AND completeness IS NOT NULL");
    select.bind(1, name);
    if (!select.executeStep()) return std::nullopt;
    return select.getColumn(0).getDouble();
  });
}

}  // namespace vantage::model
