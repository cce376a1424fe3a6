// vantage log: what is in an LCM log, parts of it, and other formats.
#include "messaging/log.h"

#include <CLI/CLI.hpp>
#include <cmath>
#include <limits>
#include <regex>
#include <sstream>

#include "messaging/bus.h"
#include "messaging/channels.h"
#include "messaging/frame_link.h"
#include "messaging/log_summary.h"
#include "rgbd/bop_writer.h"
#include "vantage/log_csv.h"
#include "vantage/verb.h"

namespace vantage::cli {
namespace {

struct LogOptions {
  CommonOptions common;
  std::string log;
  std::string out;
  double from_s = 0.0;
  double to_s = std::numeric_limits<double>::infinity();
  std::string channels = ".*";
  std::string without;
  std::string bop;
  std::string csv;
};

Json ToJson(const messaging::ChannelSummary& channel) {
  Json json;
  json["type"] = channel.type;
  json["messages"] = channel.messages;
  if (channel.type == "image_part_t") {
    json["images"] = channel.images;
    json["lost_images"] = channel.lost_images;
  }
  json["rate_hz"] = channel.rate_hz();
  json["longest_pause_s"] = 1e-6 * static_cast<double>(channel.longest_pause_us);
  json["bytes"] = channel.bytes;
  json["largest_bytes"] = channel.largest_bytes;
  json["refused"] = channel.refused;
  json["backwards"] = channel.backwards;
  return json;
}

Json ToJson(const messaging::LogSummary& summary) {
  Json json;
  json["events"] = summary.events;
  json["first_us"] = summary.first_us;
  json["duration_s"] = summary.duration_s();
  json["channels"] = Json::object();
  for (const auto& [name, channel] : summary.channels) json["channels"][name] = ToJson(channel);
  json["unknown_channels"] = summary.UnknownChannels();
  json["damage"] = {{"places", summary.damage.places},
                    {"skipped_bytes", summary.damage.skipped_bytes},
                    {"first_offset", summary.damage.first_offset},
                    {"cut_off", summary.damage.cut_off}};
  json["problems"] = summary.Problems();
  return json;
}

std::string Table(const messaging::LogSummary& summary) {
  std::ostringstream text;
  char line[200];
  std::snprintf(line, sizeof line, "%lld events in %.1f s\n", static_cast<long long>(summary.events), summary.duration_s());
  text << line;
  std::snprintf(line, sizeof line, "%-24s %-20s %9s %9s %9s %10s %9s %6s\n", "channel", "type", "messages", "rate Hz", "pause s",
                "MB", "largest", "lost");
  text << line;
  for (const auto& [name, channel] : summary.channels) {
    std::snprintf(line, sizeof line, "%-24.60s %-20s %9lld %9.2f %9.2f %10.3f %9lld %6lld\n", name.c_str(), channel.type.c_str(),
                  static_cast<long long>(channel.messages), channel.rate_hz(), 1e-6 * static_cast<double>(channel.longest_pause_us),
                  1e-6 * static_cast<double>(channel.bytes), static_cast<long long>(channel.largest_bytes),
                  static_cast<long long>(channel.lost_images));
    text << line;
  }
  for (const auto& name : summary.UnknownChannels()) text << name << ": not a channel of ours\n";
  for (const auto& problem : summary.Problems()) text << problem << '\n';
  return text.str();
}

void RunInfo(const LogOptions& options) {
  CheckOutput(options.common);
  messaging::LogReader log(options.log);
  const auto summary = messaging::Summarise(log);
  WriteResult(options.common, ToJson(summary), Table(summary));
}

void RunVerify(const LogOptions& options) {
  CheckOutput(options.common);
  messaging::LogReader log(options.log);
  const auto summary = messaging::Summarise(log);
  const auto problems = summary.Problems();
  std::string text;
  for (const auto& problem : problems) text += problem + '\n';
  if (problems.empty()) {
    text = std::to_string(summary.events) + " events in " + std::to_string(summary.channels.size()) +
           " channels: no gap, nothing damaged, nothing a node would refuse\n";
  }
  WriteResult(options.common, ToJson(summary), text);
  if (problems.empty()) return;
  throw std::runtime_error(options.log + ": " + std::to_string(problems.size()) +
                           (problems.size() == 1 ? " problem" : " problems") + ", the first: " + problems.front());
}

messaging::LogReader OpenLog(const std::string& file) {
  messaging::LogReader log(file);
  if (log.bytes() == 0) throw std::runtime_error(file + ": there is nothing in this log");
  return log;
}

// For people; empty where nothing is damaged.
std::string PassedOver(const messaging::LogDamage& damage) {
  if (damage.places == 0) return "";
  return std::to_string(damage.places) + (damage.places == 1 ? " damaged place was" : " damaged places were") + " passed over" +
         (damage.cut_off ? "; the log is cut off at its end\n" : "\n");
}

std::regex Regex(const std::string& option, const std::string& text) {
  try {
    return std::regex(text, std::regex::extended);
  } catch (const std::regex_error&) {
    throw std::runtime_error(option + " '" + text + "' is no regular expression");
  }
}

// Copies what is wanted; events keep their times.
void RunCopy(const LogOptions& options) {
  CheckOutput(options.common);
  if (!(options.from_s <= options.to_s)) throw std::runtime_error("--from must not be after --to");
  const std::regex channels = Regex("--channels", options.channels);
  const std::regex without = Regex("--without", options.without.empty() ? "x" : options.without);
  messaging::LogReader log = OpenLog(options.log);
  CheckWritable(options.out);
  messaging::LogWriter out(options.out);
  std::int64_t events = 0;
  std::int64_t first_us = 0;
  while (const auto event = log.Next()) {
    if (events++ == 0) first_us = event->time_us;
    const double time_s = 1e-6 * static_cast<double>(event->time_us - first_us);
    if (time_s < options.from_s || time_s > options.to_s || !std::regex_match(event->channel, channels)) continue;
    if (!options.without.empty() && std::regex_match(event->channel, without)) continue;
    out.Write(*event);
  }
  out.Close();
  Json result;
  result["events_in"] = events;
  result["events_out"] = out.events();
  result["damaged_places"] = log.damage().places;
  std::ostringstream text;
  text << out.events() << " of " << events << " events\n" << PassedOver(log.damage());
  WriteResult(options.common, result, text.str());
}

// Puts the log's frames together and writes them; ids are the source's own where they ascend, else they go on counting.
class SceneExport {
 public:
  explicit SceneExport(const std::string& folder) : bus_("memq://"), receiver_(bus_), writer_(folder) {}

  void Add(const messaging::LogEvent& event) {
    if (event.channel != messaging::kSensorColor && event.channel != messaging::kSensorDepth) return;
    bus_.PublishRaw(event.channel, event.data.data(), event.data.size());
    bus_.Drain();
    const auto received = receiver_.Take();
    if (!received) return;
    const auto wanted = std::min<std::int64_t>(received->frame.id, 999999);
    next_id_ = wanted >= next_id_ ? static_cast<int>(wanted) : next_id_;
    writer_.Add(next_id_++, received->frame, received->encoded_color);
  }
  void Finish() { writer_.Finish(); }
  int frames() const { return writer_.frames(); }
  std::int64_t lost() const { return receiver_.gaps(); }

 private:
  messaging::Bus bus_;
  messaging::FrameReceiver receiver_;
  rgbd::BopWriter writer_;
  int next_id_ = 0;
};

void RunExport(const LogOptions& options) {
  CheckOutput(options.common);
  if (options.bop.empty() && options.csv.empty()) throw std::runtime_error("say what to write: --bop DIR, --csv DIR or both");
  messaging::LogReader log = OpenLog(options.log);
  std::unique_ptr<SceneExport> scene;
  std::unique_ptr<LogTables> tables;
  if (!options.bop.empty()) scene = std::make_unique<SceneExport>(options.bop);
  if (!options.csv.empty()) tables = std::make_unique<LogTables>(options.csv);
  std::int64_t messages = 0, left_out = 0;
  while (const auto event = log.Next()) {
    ++messages;
    if (scene) scene->Add(*event);
    if (tables && !tables->Add(*event)) ++left_out;
  }
  Json result;
  std::ostringstream text;
  if (scene) {
    if (scene->frames() == 0) throw std::runtime_error(options.log + ": no whole frame in it, so there is no scene to write");
    scene->Finish();
    result["frames"] = scene->frames();
    result["lost_frames"] = scene->lost();
    text << scene->frames() << " frames, " << scene->lost() << " lost\n";
  }
  if (tables) {
    tables->Finish();
    if (left_out == messages) {
      throw std::runtime_error(options.log + ": nothing in it for tables; all its " + std::to_string(messages) +
                               " messages are of other types or would be refused");
    }
    result["rows"] = tables->rows();
    result["left_out"] = left_out;
    for (const auto& [channel, rows] : tables->rows()) text << channel << ".csv: " << rows << " rows\n";
    if (left_out > 0) text << left_out << " messages are of other types or would be refused: left out\n";
  }
  result["damaged_places"] = log.damage().places;
  text << PassedOver(log.damage());
  WriteResult(options.common, result, text.str());
}

}  // namespace

void AddLog(CLI::App& app, Run& run) {
  CLI::App* verb = app.add_subcommand("log", "What is in an LCM log, parts of it, other formats");
  verb->require_subcommand(1);
  verb->set_version_flag("--version", "vantage " VANTAGE_VERSION);
  auto options = std::make_shared<LogOptions>();
  CLI::App* info = verb->add_subcommand("info", "Every channel: type, rate, longest pause, size, losses");
  CLI::App* verify = verb->add_subcommand("verify", "Exit code 1 where anything is lost, damaged or would be refused");
  CLI::App* cut = verb->add_subcommand("cut", "A span of time as a log of its own");
  CLI::App* filter = verb->add_subcommand("filter", "Some channels as a log of their own");
  CLI::App* convert = verb->add_subcommand("export", "Frames as a BOP scene folder, messages as CSV tables");
  for (CLI::App* action : {info, verify, cut, filter, convert}) {
    AddCommonOptions(*action, options->common);
    action->add_option("--log,log", options->log, "The LCM log")->required()->type_name("FILE");
  }
  for (CLI::App* action : {cut, filter}) {
    action->add_option("--out", options->out, "The log to write; must not exist yet")->required()->type_name("FILE");
  }
  cut->add_option("--from", options->from_s, "Seconds since the log's first event")->capture_default_str();
  cut->add_option("--to", options->to_s, "Seconds since the log's first event; default: its end");
  filter->add_option("--channels", options->channels, "Regular expression of the channels to keep")->capture_default_str();
  filter->add_option("--without", options->without, "Regular expression of channels to leave out of these");
  convert->add_option("--bop", options->bop, "Folder for rgb/, depth/ and scene_camera.json")->type_name("DIR");
  convert->add_option("--csv", options->csv, "Folder for CHANNEL.csv")->type_name("DIR");
  info->callback([options, &run] { run = [options] { RunInfo(*options); }; });
  verify->callback([options, &run] { run = [options] { RunVerify(*options); }; });
  for (CLI::App* action : {cut, filter}) action->callback([options, &run] { run = [options] { RunCopy(*options); }; });
  convert->callback([options, &run] { run = [options] { RunExport(*options); }; });
}

}  // namespace vantage::cli
