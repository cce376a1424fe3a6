#include "model/store.h"

#include <SQLiteCpp/Exception.h>
#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>
#include <unistd.h>

#include "measures/text.h"
#include "model/blobs.h"

namespace vantage::model {
namespace {

constexpr int kApplicationId = 0x56616e74;  // "Vant"; `file` shows it.
constexpr int kSchemaVersion = 1;
constexpr int kBusyTimeoutMs = 5000;

// `revision` is one counter for the whole store, so that an object that was removed and learned anew never looks unchanged.
constexpr const char* kSchema = R"(
CREATE TABLE store (id INTEGER PRIMARY KEY CHECK (id = 1), revision INTEGER NOT NULL);
INSERT INTO store VALUES (1, 0);
CREATE TABLE object (
  id INTEGER PRIMARY KEY,
  name TEXT NOT NULL UNIQUE,
  revision INTEGER NOT NULL,
  feature_fingerprint TEXT NOT NULL,
  measures TEXT NOT NULL,
  completeness REAL,
  point_count INTEGER NOT NULL,
  points BLOB NOT NULL);
CREATE TABLE view (
  object INTEGER NOT NULL REFERENCES object(id) ON DELETE CASCADE,
  id INTEGER NOT NULL,
  utime INTEGER NOT NULL,
  frame_id INTEGER NOT NULL,
  frame_utime INTEGER NOT NULL,
  frame_number INTEGER NOT NULL,
  camera BLOB NOT NULL,
  t_world_camera BLOB,
  color BLOB NOT NULL,
  depth BLOB NOT NULL,
  mask BLOB NOT NULL,
  keypoints BLOB NOT NULL,
  descriptors BLOB NOT NULL,
  t_camera_object BLOB NOT NULL,
  points BLOB NOT NULL,
  UNIQUE (object, id));
)";

std::string WhatToDo(const SQLite::Exception& error) {
  switch (error.getErrorCode()) {
    case SQLITE_NOTADB:
      return "is not a model store (no SQLite file); give the path of a store";
    case SQLITE_CORRUPT:
      return "is damaged; restore a copy or learn its objects again";
    case SQLITE_FULL:
      return "cannot grow, the disk is full; nothing was changed";
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return "was locked by another writer for more than 5 s; nothing was changed. A store has one writer";
    case SQLITE_READONLY:
    case SQLITE_CANTOPEN:
    case SQLITE_PERM:
      return "cannot be opened or written; check the permissions of the file and its folder";
    default:
      return std::string("database error: ") + error.what();
  }
}

// Runs the action; what SQLite throws becomes one line that names the file and what to do.
template <typename Action>
auto Translated(const std::filesystem::path& file, const Action& action) {
  try {
    return action();
  } catch (const SQLite::Exception& error) {
    throw std::runtime_error(file.string() + ": " + WhatToDo(error));
  }
}

void BindBlob(SQLite::Statement& statement, int index, const Blob& blob) {
  statement.bind(index, blob.data(), static_cast<int>(blob.size()));
}

Blob ColumnBlob(SQLite::Statement& statement, int index) {
  const SQLite::Column column = statement.getColumn(index);
  const void* bytes = column.getBlob();
  return bytes == nullptr ? Blob() : Blob(static_cast<const char*>(bytes), static_cast<std::size_t>(column.getBytes()));
}

int IntegerPragma(SQLite::Database& database, const std::string& name) { return database.execAndGet("PRAGMA " + name).getInt(); }

bool IsEmptyDatabase(SQLite::Database& database) {
  return IntegerPragma(database, "application_id") == 0 && database.execAndGet("SELECT count(*) FROM sqlite_master").getInt() == 0;
}

void CreateSchema(SQLite::Database& database) {
  database.exec("PRAGMA journal_mode = WAL");
  database.exec("PRAGMA synchronous = FULL");
  SQLite::Transaction transaction(database, SQLite::TransactionBehavior::IMMEDIATE);
  database.exec(kSchema);
  database.exec("PRAGMA application_id = " + std::to_string(kApplicationId));
  database.exec("PRAGMA user_version = " + std::to_string(kSchemaVersion));
  transaction.commit();
}

// A new store appears under its name only when it is whole: readers that are waiting for it never see half a schema.
void CreateFile(const std::filesystem::path& file) {
  const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
  if (!std::filesystem::is_directory(folder)) {
    throw std::runtime_error(file.string() + ": no folder " + folder.string() + "; create it first");
  }
  std::filesystem::path temporary = file;
  temporary += ".new-" + std::to_string(::getpid());
  std::error_code ignored;
  std::filesystem::remove(temporary, ignored);
  try {
    {
      SQLite::Database database(temporary.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE, kBusyTimeoutMs);
      CreateSchema(database);
    }
    // A hard link fails where another writer was faster; then its store is the one that counts.
    std::error_code failed;
    std::filesystem::create_hard_link(temporary, file, failed);
    if (failed && !std::filesystem::exists(file)) std::filesystem::rename(temporary, file);
  } catch (...) {
    std::filesystem::remove(temporary, ignored);
    throw;
  }
  std::filesystem::remove(temporary, ignored);
}

// SQLite needs to write beside a WAL database even to read it, and only who may write tidies up after the last reader: so a reader
// opens the file like a writer where it may, and forbids itself to write. In a folder that nobody may write to nothing changes.
std::string ReaderUri(const std::filesystem::path& file) {
  const std::filesystem::path absolute = std::filesystem::absolute(file);
  std::string escaped;
  for (const char c : absolute.string()) {
    switch (c) {
      case '%':
        escaped += "%25";
        break;
      case '?':
        escaped += "%3f";
        break;
      case '#':
        escaped += "%23";
        break;
      default:
        escaped += c;
    }
  }
  std::error_code missing;
  const std::uintmax_t wal_bytes = std::filesystem::file_size(absolute.string() + "-wal", missing);
  const bool has_wal = !missing && wal_bytes > 0;
  const bool folder_is_writable = ::access(absolute.parent_path().c_str(), W_OK) == 0;
  if (folder_is_writable && ::access(absolute.c_str(), W_OK) == 0) return "file:" + escaped + "?mode=rw";
  return "file:" + escaped + (folder_is_writable || has_wal ? "?mode=ro" : "?mode=ro&immutable=1");
}

void CheckIsOurs(SQLite::Database& database, const std::filesystem::path& file) {
  const int application = IntegerPragma(database, "application_id");
  if (application != kApplicationId) {
    throw std::runtime_error(file.string() +
                             ": is not a model store (an SQLite file of another application); give the path of a store");
  }
  const int version = IntegerPragma(database, "user_version");
  if (version < 1 || version > kSchemaVersion) {
    throw std::runtime_error(file.string() + ": has schema version " + std::to_string(version) + ", this program reads up to " +
                             std::to_string(kSchemaVersion) + "; use a newer program");
  }
}

void CheckView(const ObjectModel& model, const View& view) {
  const std::string where = "object '" + model.name + "', view " + std::to_string(view.id) + ": ";
  const int count = view.features.size();
  if (view.features.descriptors.rows != count || static_cast<int>(view.points.size()) != count) {
    throw std::invalid_argument(where + std::to_string(count) + " keypoints need as many descriptors and points, there are " +
                                std::to_string(view.features.descriptors.rows) + " and " + std::to_string(view.points.size()));
  }
  for (const int point : view.points) {
    if (point < -1 || point >= static_cast<int>(model.points.size())) {
      throw std::invalid_argument(where + "there is no model point " + std::to_string(point));
    }
  }
}

void InsertView(SQLite::Database& database, std::int64_t object, const ObjectModel& model, const View& view) {
  CheckView(model, view);
  SQLite::Statement insert(database, "INSERT INTO view VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  insert.bind(1, object);
  insert.bind(2, view.id);
  insert.bind(3, view.utime);
  insert.bind(4, view.frame_id);
  insert.bind(5, view.keyframe.utime);
  insert.bind(6, view.keyframe.id);
  BindBlob(insert, 7, EncodeCamera(view.keyframe.camera));
  if (view.keyframe.T_world_camera) BindBlob(insert, 8, EncodeRigid(*view.keyframe.T_world_camera));
  BindBlob(insert, 9, EncodeImage(view.keyframe.color));
  BindBlob(insert, 10, EncodeImage(view.keyframe.depth));
  BindBlob(insert, 11, EncodeImage(view.mask));
  BindBlob(insert, 12, EncodeKeypoints(view.features.keypoints));
  BindBlob(insert, 13, EncodeDescriptors(view.features.descriptors));
  BindBlob(insert, 14, EncodeRigid(view.T_camera_object));
  BindBlob(insert, 15, EncodeIndices(view.points));
  insert.exec();
}

// What refinement and loop closure change in a view that is stored already.
void UpdateView(SQLite::Database& database, std::int64_t object, const ObjectModel& model, const View& view) {
  CheckView(model, view);
  SQLite::Statement update(database, "UPDATE view SET t_camera_object = ?, points = ? WHERE object = ? AND id = ?");
  BindBlob(update, 1, EncodeRigid(view.T_camera_object));
  BindBlob(update, 2, EncodeIndices(view.points));
  update.bind(3, object);
  update.bind(4, view.id);
  if (update.exec() != 1) {
    throw std::invalid_argument("object '" + model.name + "', view " + std::to_string(view.id) +
                                " was never stored; save the whole object");
  }
}

std::optional<std::int64_t> ObjectRow(SQLite::Database& database, const std::string& name) {
  SQLite::Statement select(database, "SELECT id FROM object WHERE name = ?");
  select.bind(1, name);
  if (!select.executeStep()) return std::nullopt;
  return select.getColumn(0).getInt64();
}

std::int64_t NextRevision(SQLite::Database& database) {
  database.exec("UPDATE store SET revision = revision + 1");
  return database.execAndGet("SELECT revision FROM store").getInt64();
}

// The object's own row; measures and completeness stay where it exists.
std::int64_t WriteObject(SQLite::Database& database, const ObjectModel& model) {
  if (model.name.empty()) throw std::invalid_argument("an object needs a name");
  SQLite::Statement write(
      database,
      "INSERT INTO object (name, revision, feature_fingerprint, measures, point_count, points) "
      "VALUES (?1, ?2, ?3, ?4, ?5, ?6) "
      "ON CONFLICT (name) DO UPDATE SET revision = ?2, feature_fingerprint = ?3, point_count = ?5, points = ?6");
  write.bind(1, model.name);
  write.bind(2, NextRevision(database));
  write.bind(3, model.feature_fingerprint);
  write.bind(4, measures::ToText(model.measures));
  write.bind(5, static_cast<std::int64_t>(model.points.size()));
  BindBlob(write, 6, EncodePoints(model.points));
  write.exec();
  return *ObjectRow(database, model.name);
}

void RemoveObject(SQLite::Database& database, const std::string& name) {
  SQLite::Statement remove(database, "DELETE FROM object WHERE name = ?");
  remove.bind(1, name);
  remove.exec();
}

// Columns as in LoadViews' SELECT.
View ReadView(SQLite::Statement& row, int point_count) {
  View view;
  std::string part;
  try {
    const auto blob = [&](int column, const char* name) {
      part = name;
      return ColumnBlob(row, column);
    };
    view.id = row.getColumn(0).getInt();
    view.utime = row.getColumn(1).getInt64();
    view.frame_id = row.getColumn(2).getInt64();
    view.keyframe.utime = row.getColumn(3).getInt64();
    view.keyframe.id = row.getColumn(4).getInt64();
    view.keyframe.camera = DecodeCamera(blob(5, "camera"));
    if (!row.getColumn(6).isNull()) view.keyframe.T_world_camera = DecodeRigid(blob(6, "camera pose"));
    view.keyframe.color = DecodeImage(blob(7, "colour image"), CV_8UC3);
    view.keyframe.depth = DecodeImage(blob(8, "depth image"), CV_16UC1);
    view.mask = DecodeImage(blob(9, "mask"), CV_8UC1);
    view.features.keypoints = DecodeKeypoints(blob(10, "keypoints"));
    view.features.descriptors = DecodeDescriptors(blob(11, "descriptors"), view.features.size());
    view.T_camera_object = DecodeRigid(blob(12, "object pose"));
    view.points = DecodeIndices(blob(13, "links to model points"));
    if (static_cast<int>(view.points.size()) != view.features.size()) throw std::runtime_error("not one per keypoint");
    for (const int point : view.points) {
      if (point < -1 || point >= point_count) throw std::runtime_error("there is no point " + std::to_string(point));
    }
  } catch (const std::exception& error) {
    throw std::runtime_error("view " + std::to_string(view.id) + " is damaged (" + part + ": " + error.what() + ")");
  }
  return view;
}

std::vector<View> LoadViews(SQLite::Database& database, std::int64_t object, int point_count) {
  SQLite::Statement select(database,
                           "SELECT id, utime, frame_id, frame_utime, frame_number, camera, t_world_camera, color, depth, mask, "
                           "keypoints, descriptors, t_camera_object, points FROM view WHERE object = ? ORDER BY id");
  select.bind(1, object);
  std::vector<View> views;
  while (select.executeStep()) views.push_back(ReadView(select, point_count));
  return views;
}

}  // namespace

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

void Store::AddView(const ObjectModel& model, int view) {
  if (view < 0 || view >= static_cast<int>(model.views.size())) {
    throw std::invalid_argument("object '" + model.name + "' has no view with index " + std::to_string(view));
  }
  impl_->Change(file_, [&] {
    const std::int64_t object = WriteObject(impl_->database, model);
    for (int i = 0; i < static_cast<int>(model.views.size()); ++i) {
      if (i != view) UpdateView(impl_->database, object, model, model.views[static_cast<std::size_t>(i)]);
    }
    const View& added = model.views[static_cast<std::size_t>(view)];
    SQLite::Statement stored(impl_->database, "SELECT count(*), coalesce(sum(id = ?), 0) FROM view WHERE object = ?");
    stored.bind(1, added.id);
    stored.bind(2, object);
    if (!stored.executeStep() || stored.getColumn(0).getInt() != static_cast<int>(model.views.size()) - 1 ||
        stored.getColumn(1).getInt() != 0) {
      throw std::invalid_argument("object '" + model.name +
                                  "' as stored has views beside the model's others; save the whole object");
    }
    InsertView(impl_->database, object, model, added);
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
