#include "vantage/log_csv.h"

#include <functional>
#include <stdexcept>
#include <vantage/answer_t.hpp>
#include <vantage/completeness_t.hpp>
#include <vantage/detections_t.hpp>
#include <vantage/host_clock_t.hpp>
#include <vantage/image_part_t.hpp>
#include <vantage/measures_t.hpp>
#include <vantage/mount_command_t.hpp>
#include <vantage/mount_state_t.hpp>
#include <vantage/object_prior_t.hpp>
#include <vantage/operator_command_t.hpp>
#include <vantage/plan_t.hpp>
#include <vantage/query_t.hpp>
#include <vantage/reach_t.hpp>
#include <vantage/scene_t.hpp>
#include <vantage/status_t.hpp>
#include <vantage/store_list_t.hpp>
#include <vantage/store_part_t.hpp>
#include <vantage/store_query_t.hpp>
#include <vantage/track_t.hpp>
#include <vantage/view_t.hpp>
#include <vector>

#include "messaging/known_types.h"

namespace vantage::cli {
namespace {

// One row: names of the columns beside their values, so that they cannot slip.
class Row {
 public:
  Row& Add(const std::string& name, const std::string& value) {
    std::string cell = value;
    if (cell.find_first_of(",\"\n\r") != std::string::npos) {
      for (std::size_t at = 0; (at = cell.find('"', at)) != std::string::npos; at += 2) cell.insert(at, 1, '"');
      cell = '"' + cell + '"';
    }
    return Append(name, cell);
  }
  Row& Add(const std::string& name, double value) {
    char text[40];
    std::snprintf(text, sizeof text, "%.9g", value);
    return Append(name, text);
  }
  Row& Add(const std::string& name, std::int64_t value) { return Append(name, std::to_string(value)); }
  Row& Add(const std::string& name, const pose_t& pose) {
    for (int i = 0; i < 3; ++i) Add(name + "_" + "xyz"[i], pose.position[i]);
    for (int i = 0; i < 4; ++i) Add(name + "_q" + "wxyz"[i], pose.orientation[i]);
    return *this;
  }

  const std::string& names() const { return names_; }
  const std::string& values() const { return values_; }

 private:
  Row& Append(const std::string& name, const std::string& cell) {
    if (!names_.empty()) names_ += ',', values_ += ',';
    names_ += name;
    values_ += cell;
    return *this;
  }
  std::string names_;
  std::string values_;
};
using Rows = std::vector<Row>;

std::int64_t Integer(bool value) { return value ? 1 : 0; }

Row Begin(std::int64_t utime) { return Row().Add("utime", utime); }

// A row for every item of a message: `add` adds the item's columns to the message's own.
template <typename Items, typename AddItem>
Rows RowPerItem(const Row& message, const Items& items, const AddItem& add) {
  Rows rows;
  for (const auto& item : items) {
    rows.push_back(message);
    add(rows.back(), item);
  }
  return rows;
}

Rows ToRows(const image_part_t& m) {
  return {Begin(m.utime)
              .Add("sequence", m.sequence)
              .Add("frame_id", m.frame_id)
              .Add("encoding", std::int64_t{m.encoding})
              .Add("width", std::int64_t{m.camera.width})
              .Add("height", std::int64_t{m.camera.height})
              .Add("part", std::int64_t{m.part})
              .Add("parts", std::int64_t{m.parts})
              .Add("part_bytes", std::int64_t{m.size})
              .Add("total_bytes", std::int64_t{m.total_size})
              .Add("T_world_camera_known", Integer(m.T_world_camera_known))
              .Add("T_world_camera", m.T_world_camera)};
}
Rows ToRows(const mount_state_t& m) {
  return {Begin(m.utime)
              .Add("moving", Integer(m.moving))
              .Add("command_id", m.command_id)
              .Add("result", std::int64_t{m.result})
              .Add("refusal", m.refusal)
              .Add("T_world_mount", m.T_world_mount)
              .Add("T_mount_camera", m.T_mount_camera)};
}
Rows ToRows(const mount_command_t& m) {
  return RowPerItem(Begin(m.utime).Add("command_id", m.command_id), m.waypoints, [](Row& row, const auto& waypoint) {
    row.Add("time_s", waypoint.time_s).Add("T_world_mount", waypoint.T_world_mount);
  });
}
Rows ToRows(const track_t& m) {
  return {Begin(m.utime)
              .Add("sequence", m.sequence)
              .Add("object", m.object)
              .Add("state", m.state)
              .Add("tracked", Integer(m.tracked))
              .Add("confidence", m.confidence)
              .Add("probability", m.probability)
              .Add("support", std::int64_t{m.support})
              .Add("visible", std::int64_t{m.visible})
              .Add("reference_view", std::int64_t{m.reference_view})
              .Add("inliers", std::int64_t{m.inliers})
              .Add("view_added", Integer(m.view_added))
              .Add("views", std::int64_t{m.views})
              .Add("points", std::int64_t{m.points})
              .Add("process_ms", m.process_ms)
              .Add("T_camera_object", m.T_camera_object)
              .Add("T_world_object_known", Integer(m.T_world_object_known))
              .Add("T_world_object", m.T_world_object)
              .Add("note", m.note)};
}
Rows ToRows(const view_t& m) {
  return {Begin(m.utime)
              .Add("frame_id", m.frame_id)
              .Add("object", m.object)
              .Add("view_id", std::int64_t{m.view_id})
              .Add("views", std::int64_t{m.views})
              .Add("points", std::int64_t{m.points})
              .Add("features", std::int64_t{m.features})
              .Add("distance_m", m.viewpoint.distance_m)
              .Add("T_camera_object", m.T_camera_object)};
}
Rows ToRows(const scene_t& m) {
  Rows rows;
  for (const auto& hull : m.hulls) {
    const Rows of_hull =
        RowPerItem(Begin(m.utime).Add("object", m.object).Add("hull", hull.name), hull.points,
                   [](Row& row, const auto& point) { row.Add("x", point[0]).Add("y", point[1]).Add("z", point[2]); });
    rows.insert(rows.end(), of_hull.begin(), of_hull.end());
  }
  return rows;
}
Rows ToRows(const detections_t& m) {
  return RowPerItem(Begin(m.utime).Add("sequence", m.sequence), m.detections, [&](Row& row, const auto& d) {
    row.Add("object", d.object)
        .Add("probability", d.probability)
        .Add("confidence", d.confidence)
        .Add("support", std::int64_t{d.support})
        .Add("visible", std::int64_t{d.visible})
        .Add("view", std::int64_t{d.view})
        .Add("inliers", std::int64_t{d.inliers})
        .Add("source", d.source)
        .Add("process_ms", m.process_ms)
        .Add("T_camera_object", d.T_camera_object);
  });
}
Rows ToRows(const measures_t& m) {
  return {Begin(m.utime)
              .Add("object", m.object)
              .Add("views", std::int64_t{m.views})
              .Add("completeness", m.completeness)
              .Add("observed_source", m.observed_source)
              .Add("positive_mean", m.positive.mean)
              .Add("positive_sigma", m.positive.sigma)
              .Add("positive_count", std::int64_t{m.positive.count})
              .Add("negative_mean", m.negative.mean)
              .Add("negative_sigma", m.negative.sigma)
              .Add("negative_count", std::int64_t{m.negative.count})
              .Add("predicted_source", m.predicted_source)
              .Add("common_cause", m.common_cause)};
}
Rows ToRows(const completeness_t& m) {
  return {Begin(m.utime)
              .Add("object", m.object)
              .Add("rule", m.rule)
              .Add("completeness", m.completeness)
              .Add("reach_known", Integer(m.reach_known))
              .Add("distance_m", m.distance_m)
              .Add("views", std::int64_t{m.views})};
}
Rows ToRows(const reach_t& m) {
  return RowPerItem(Begin(m.utime).Add("object", m.object), m.viewpoints, [](Row& row, const auto& v) {
    for (int i = 0; i < 3; ++i) row.Add(std::string("direction_") + "xyz"[i], v.viewpoint.direction[i]);
    row.Add("distance_m", v.viewpoint.distance_m).Add("weight", v.weight);
  });
}
Rows ToRows(const host_clock_t& m) {
  return RowPerItem(Begin(m.utime).Add("host", m.host), m.echoes, [](Row& row, const auto& echo) {
    row.Add("other_host", echo.host).Add("sent_us", echo.sent_us).Add("received_us", echo.received_us);
  });
}
Rows ToRows(const store_list_t& m) {
  return RowPerItem(Begin(m.utime).Add("host", m.host), m.entries,
                    [](Row& row, const auto& entry) { row.Add("object", entry.object).Add("revision", entry.revision); });
}
Rows ToRows(const store_query_t& m) {
  return {Begin(m.utime).Add("request", m.request).Add("object", m.object).Add("views_there", std::int64_t{m.count})};
}
Rows ToRows(const store_part_t& m) {
  return {Begin(m.utime)
              .Add("request", m.request)
              .Add("revision", m.revision)
              .Add("part", std::int64_t{m.part})
              .Add("parts", std::int64_t{m.parts})
              .Add("part_bytes", std::int64_t{m.size})
              .Add("total_bytes", std::int64_t{m.total_size})};
}
Rows ToRows(const plan_t& m) {
  Row row = Begin(m.utime)
                .Add("run_id", m.run_id)
                .Add("object", m.object)
                .Add("state", m.state)
                .Add("decision", std::int64_t{m.decision})
                .Add("completeness", m.completeness)
                .Add("elapsed_s", m.elapsed_s)
                .Add("attempts", std::int64_t{m.attempts})
                .Add("failed_attempts", std::int64_t{m.failed_attempts})
                .Add("views", std::int64_t{m.views})
                .Add("candidates", std::int64_t{m.count})
                .Add("chosen", std::int64_t{m.chosen})
                .Add("stop_reason", m.stop_reason);
  return {row};
}
Rows ToRows(const query_t& m) {
  return {Begin(m.utime)
              .Add("query_id", m.query_id)
              .Add("object", m.object)
              .Add("frame", std::int64_t{m.frame})
              .Add("T_frame_camera", m.T_frame_camera)};
}
Rows ToRows(const answer_t& m) {
  return {Begin(m.utime)
              .Add("query_id", m.query_id)
              .Add("object", m.object)
              .Add("known", Integer(m.known))
              .Add("probability", m.probability)
              .Add("source", m.source)
              .Add("error", m.error)};
}
Rows ToRows(const object_prior_t& m) {
  return {Begin(m.utime).Add("object", m.object).Add("probability", m.probability).Add("source", m.source)};
}
Rows ToRows(const operator_command_t& m) {
  return {Begin(m.utime).Add("process", m.process).Add("command", m.command).Add("argument", m.argument)};
}
Rows ToRows(const status_t& m) {
  std::string counters;
  for (const auto& counter : m.counters) {
    counters += (counters.empty() ? "" : "; ") + counter.name + " " + std::to_string(counter.total);
  }
  std::string latencies;
  for (const auto& latency : m.latencies) {
    latencies += (latencies.empty() ? "" : "; ") + latency.channel + " " + std::to_string(latency.median_ms);
  }
  return {Begin(m.utime)
              .Add("process", m.process)
              .Add("state", m.state)
              .Add("detail", m.detail)
              .Add("uptime_s", m.uptime_s)
              .Add("gaps", m.gaps)
              .Add("skipped", m.skipped)
              .Add("bad", m.bad)
              .Add("last_error", m.last_error)
              .Add("counters", counters)
              .Add("median_latency_ms", latencies)};
}

template <typename Message>
Rows RowsOf(const messaging::LogEvent& event) {
  Message message;
  message.decode(event.data.data(), 0, static_cast<int>(event.data.size()));
  return ToRows(message);
}

using Convert = std::function<Rows(const messaging::LogEvent&)>;
template <typename... Message>
std::map<std::string, Convert> MakeConverters() {
  return {{Message::getTypeName(), RowsOf<Message>}...};
}

}  // namespace

LogTables::LogTables(const std::filesystem::path& folder) : folder_(folder) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) throw std::runtime_error(folder.string() + ": cannot be made: " + failed.message());
}

bool LogTables::Add(const messaging::LogEvent& event) {
  static const std::map<std::string, Convert> converters =
      MakeConverters<answer_t, completeness_t, detections_t, host_clock_t, image_part_t, measures_t, mount_command_t, mount_state_t,
                     object_prior_t, operator_command_t, plan_t, query_t, reach_t, scene_t, status_t, store_list_t, store_part_t,
                     store_query_t, track_t, view_t>();
  const auto converter = converters.find(messaging::TypeOfChannel(event.channel));
  if (converter == converters.end()) return false;
  if (!messaging::WhyRefused(event.channel, event.data.data(), event.data.size()).empty()) return false;
  for (const Row& row : converter->second(event)) {
    auto [file, is_new] = files_.try_emplace(event.channel);
    if (is_new) {
      file->second.open(folder_ / (event.channel + ".csv"));
      file->second << "log_time_us," << row.names() << '\n';
    }
    file->second << event.time_us << ',' << row.values() << '\n';
    ++rows_[event.channel];
  }
  return true;
}

void LogTables::Finish() {
  for (auto& [channel, file] : files_) {
    file.close();
    if (!file) throw std::runtime_error((folder_ / (channel + ".csv")).string() + ": cannot be written; is the disk full?");
  }
}

}  // namespace vantage::cli
