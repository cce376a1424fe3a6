// Rows of the store: objects and views. Internal to model; all calls inside a transaction of the caller's.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "model/blobs.h"
#include "model/object_model.h"

namespace vantage::model {

Blob ColumnBlob(SQLite::Statement& statement, int index);

std::optional<std::int64_t> ObjectRow(SQLite::Database& database, const std::string& name);
std::int64_t NextRevision(SQLite::Database& database);
// The object's own row; measures and completeness stay where it exists. Returns its key.
std::int64_t WriteObject(SQLite::Database& database, const ObjectModel& model);
void RemoveObject(SQLite::Database& database, const std::string& name);

// Capture times of the stored views, by id.
std::map<int, std::int64_t> ViewTimes(SQLite::Database& database, std::int64_t object);
std::vector<View> LoadViews(SQLite::Database& database, std::int64_t object, int point_count);
// Throw std::invalid_argument where the view does not fit the model.
void InsertView(SQLite::Database& database, std::int64_t object, const ObjectModel& model, const View& view);
void UpdateView(SQLite::Database& database, std::int64_t object, const ObjectModel& model, const View& view);
void RemoveView(SQLite::Database& database, std::int64_t object, int id);

}  // namespace vantage::model
