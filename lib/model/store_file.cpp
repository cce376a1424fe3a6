#include "model/store_file.h"

#include <sqlite3.h>
#include <unistd.h>

namespace vantage::model {
namespace {

constexpr int kApplicationId = 0x56616e74;  // "Vant"; `file` shows it.
constexpr int kSchemaVersion = 1;

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

int IntegerPragma(SQLite::Database& database, const std::string& name) { return database.execAndGet("PRAGMA " + name).getInt(); }

}  // namespace

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

}  // namespace vantage::model
