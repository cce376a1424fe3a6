// The store's file: its schema, how it is made, opened and recognised, and what its errors mean. Internal to model.
#pragma once

#include <SQLiteCpp/Exception.h>
#include <SQLiteCpp/SQLiteCpp.h>

#include <filesystem>
#include <stdexcept>
#include <string>

namespace vantage::model {

inline constexpr int kBusyTimeoutMs = 5000;

// What an error of the database means to a user, and what to do.
std::string WhatToDo(const SQLite::Exception& error);

// Runs the action; what SQLite throws becomes one line that names the file and what to do.
template <typename Action>
auto Translated(const std::filesystem::path& file, const Action& action) {
  try {
    return action();
  } catch (const SQLite::Exception& error) {
    throw std::runtime_error(file.string() + ": " + WhatToDo(error));
  }
}

bool IsEmptyDatabase(SQLite::Database& database);
void CreateSchema(SQLite::Database& database);

// A new store appears under its name only when it is whole: readers that are waiting for it never see half a schema.
void CreateFile(const std::filesystem::path& file);

// SQLite needs to write beside a WAL database even to read it, and only who may write tidies up after the last reader: so a reader
// opens the file like a writer where it may, and forbids itself to write. In a folder that nobody may write to nothing changes.
std::string ReaderUri(const std::filesystem::path& file);

// Throws std::runtime_error where the database is not a store, or one of a newer schema.
void CheckIsOurs(SQLite::Database& database, const std::filesystem::path& file);

}  // namespace vantage::model
