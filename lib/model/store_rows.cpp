#include "model/store_rows.h"

#include <stdexcept>

#include "measures/text.h"

namespace vantage::model {
namespace {

void BindBlob(SQLite::Statement& statement, int index, const Blob& blob) {
  statement.bind(index, blob.data(), static_cast<int>(blob.size()));
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

}  // namespace

Blob ColumnBlob(SQLite::Statement& statement, int index) {
  const SQLite::Column column = statement.getColumn(index);
  const void* bytes = column.getBlob();
  return bytes == nullptr ? Blob() : Blob(static_cast<const char*>(bytes), static_cast<std::size_t>(column.getBytes()));
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

// What refinement, loop closure and upkeep change in a view that is stored already; its images stay as they are.
void UpdateView(SQLite::Database& database, std::int64_t object, const ObjectModel& model, const View& view) {
  CheckView(model, view);
  SQLite::Statement update(database, "UPDATE view SET t_camera_object = ?, points = ? WHERE object = ? AND id = ?");
  BindBlob(update, 1, EncodeRigid(view.T_camera_object));
  BindBlob(update, 2, EncodeIndices(view.points));
  update.bind(3, object);
  update.bind(4, view.id);
  update.exec();
  // Descriptors are the bulk of a view, and rarely change: only where some were dropped are they written again.
  const Blob keypoints = EncodeKeypoints(view.features.keypoints);
  SQLite::Statement features(database,
                             "UPDATE view SET keypoints = ?1, descriptors = ?2 WHERE object = ?3 AND id = ?4 "
                             "AND length(keypoints) <> length(?1)");
  BindBlob(features, 1, keypoints);
  BindBlob(features, 2, EncodeDescriptors(view.features.descriptors));
  features.bind(3, object);
  features.bind(4, view.id);
  features.exec();
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

void RemoveView(SQLite::Database& database, std::int64_t object, int id) {
  SQLite::Statement remove(database, "DELETE FROM view WHERE object = ? AND id = ?");
  remove.bind(1, object);
  remove.bind(2, id);
  remove.exec();
}

std::map<int, std::int64_t> ViewTimes(SQLite::Database& database, std::int64_t object) {
  SQLite::Statement select(database, "SELECT id, utime FROM view WHERE object = ?");
  select.bind(1, object);
  std::map<int, std::int64_t> times;
  while (select.executeStep()) times[select.getColumn(0).getInt()] = select.getColumn(1).getInt64();
  return times;
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

}  // namespace vantage::model
