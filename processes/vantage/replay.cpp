// vantage replay: the real nodes on a log, in lock step; the same log and seed give the same bytes on any machine load.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <limits>
#include <map>
#include <sstream>

#include "assessor/node.h"
#include "learner/node.h"
#include "messaging/channels.h"
#include "messaging/known_types.h"
#include "messaging/lock_step.h"
#include "messaging/log.h"
#include "planner/node.h"
#include "recogniser/node.h"
#include "vantage/verb.h"

namespace vantage::cli {
namespace {

namespace fs = std::filesystem;
using messaging::Node;

constexpr char kStoreName[] = "models.db";
constexpr int kJobFrames = 100;  // Where the configuration says that trials take effect as soon as they are done.

struct ReplayOptions {
  CommonOptions common;
  std::string log;
  std::string out;
  std::vector<std::string> processes = {"learner", "recogniser", "assessor", "planner"};
  std::string configs;
  std::string object;
  std::string store;
  std::string from_store;
  bool every_frame = false;
  bool keep_inputs = false;
};

// Works in a folder of its own, so that messages that name the store are the same on every run; the folder is removed.
class Workplace {
 public:
  Workplace() : before_(fs::current_path()) {
    std::string pattern = (fs::temp_directory_path() / "vantage-replay-XXXXXX").string();
    if (!::mkdtemp(pattern.data())) throw std::runtime_error(pattern + ": cannot make a folder there; is the disk full?");
    folder_ = pattern;
    fs::current_path(folder_);
  }
  ~Workplace() {
    std::error_code ignored;
    fs::current_path(before_, ignored);
    fs::remove_all(folder_, ignored);
  }
  Workplace(const Workplace&) = delete;
  Workplace& operator=(const Workplace&) = delete;

 private:
  fs::path before_;
  fs::path folder_;
};

// Channels a process speaks on beside its status.
const std::map<std::string, std::vector<std::string>>& ChannelsOfProcesses() {
  static const std::map<std::string, std::vector<std::string>> channels = {
      {"learner", {messaging::kLearnerTrack, messaging::kLearnerScene, messaging::kLearnerView}},
      {"recogniser", {messaging::kRecogniserDetections}},
      {"assessor", {messaging::kAssessorMeasures, messaging::kAssessorCompleteness, messaging::kAssessorAnswer}},
      {"planner", {messaging::kPlannerPlan, messaging::kPlannerReach, messaging::kMountCommand}},
  };
  return channels;
}

// What the nodes say themselves: it is not taken from the log.
std::vector<std::string> OwnChannels(const std::vector<std::string>& processes) {
  std::vector<std::string> own;
  for (const auto& process : processes) {
    const auto& channels = ChannelsOfProcesses().at(process);
    own.insert(own.end(), channels.begin(), channels.end());
    own.push_back(messaging::StatusChannel(process));
  }
  return own;
}

template <typename Params>
void LookAtEveryFrame(Params& params, const ReplayOptions& options) {
  if (options.every_frame) params.max_rate_hz = 1e6;
}

std::unique_ptr<Node> MakeNode(const std::string& process, const ReplayOptions& options, messaging::Bus& bus) {
  const std::string config = options.configs.empty() ? "" : (fs::path(options.configs) / (process + ".yaml")).string();
  const std::string& library = options.common.config;
  if (process == "learner") {
    auto params = learner::LoadLearnerNodeParams(config, library);
    params.store = kStoreName;
    params.learner.recogniser.seed = options.common.seed;
    if (!options.object.empty()) params.object = options.object;
    LookAtEveryFrame(params, options);
    return std::make_unique<learner::LearnerNode>(bus, params);
  }
  if (process == "recogniser") {
    auto params = recogniser::LoadRecogniserNodeParams(config, library);
    params.store = kStoreName;
    params.recogniser.seed = options.common.seed;
    LookAtEveryFrame(params, options);
    return std::make_unique<recogniser::RecogniserNode>(bus, params);
  }
  if (process == "assessor") {
    auto params = assessor::LoadAssessorNodeParams(config, library);
    params.store = kStoreName;
    params.recogniser.seed = params.trials.seed = options.common.seed;
    if (params.job_frames == 0) params.job_frames = kJobFrames;
    return std::make_unique<assessor::AssessorNode>(bus, params);
  }
  auto params = planner::LoadPlannerNodeParams(config, library);
  params.seed = options.common.seed;
  params.summary.clear();
  return std::make_unique<planner::PlannerNode>(bus, params);
}

void CheckOptions(const ReplayOptions& options) {
  CheckOutput(options.common);
  CheckWritable(options.out);
  for (const auto& process : options.processes) {
    if (!ChannelsOfProcesses().count(process)) {
      throw std::runtime_error("there is no process '" + process + "' to replay; there are learner, recogniser, assessor, planner");
    }
    if (std::count(options.processes.begin(), options.processes.end(), process) > 1) {
      throw std::runtime_error("--processes names " + process + " twice");
    }
  }
  if (!options.store.empty()) {
    CheckWritable(options.store);
    if (fs::exists(options.store)) throw std::runtime_error(options.store + ": exists; choose another name, or --from-store");
  }
  if (!options.from_store.empty()) model::Store(options.from_store, model::Store::Mode::kRead);
}

void MakeAbsolute(std::string& path) {
  if (!path.empty() && path != "-") path = fs::absolute(path).string();
}

// A whole copy of a store, whatever is still in its write-ahead log.
void CopyStore(const fs::path& from, const fs::path& to) {
  for (const char* part : {"", "-wal"}) {
    const fs::path source = from.string() + part;
    if (fs::exists(source)) fs::copy_file(source, to.string() + part, fs::copy_options::overwrite_existing);
  }
}

struct Tally {
  std::int64_t events_in = 0;
  std::int64_t left_out = 0;  // Not ours, or said by the nodes themselves.
  std::int64_t damaged_places = 0;
  std::map<std::string, std::int64_t> out;  // By channel.
};

// When a message was captured, as far as it says so; never after it was heard.
std::int64_t CaptureTime(const messaging::LogEvent& event) {
  const auto utime = messaging::UtimeOf(event.data.data(), event.data.size());
  return utime && *utime > 0 ? std::min(*utime, event.time_us) : event.time_us;
}

class Replay {
 public:
  Replay(const ReplayOptions& options, messaging::LogReader& log)
      : options_(options),
        log_(log),
        own_(OwnChannels(options.processes)),
        out_(options.out),
        clock_(Begin(log)),
        bus_("memq://", clock_.AsClock()) {
    bus_.SetTap([this](const std::string& channel, const void* data, std::size_t size) {
      if (playing_ && !options_.keep_inputs) return;
      out_.Write(clock_.now_us(), channel, data, size);
      if (!playing_) ++tally_.out[channel];
    });
    for (const auto& process : options.processes) nodes_.push_back(MakeNode(process, options, bus_));
  }

  Tally Run() {
    std::vector<Node*> nodes;
    for (const auto& node : nodes_) nodes.push_back(node.get());
    messaging::LockStep steps(clock_, bus_, nodes);
    while (const auto event = log_.Next()) {
      ++tally_.events_in;
      const bool is_own = std::count(own_.begin(), own_.end(), event->channel) > 0;
      if (is_own || messaging::TypeOfChannel(event->channel).empty()) {
        ++tally_.left_out;
        continue;
      }
      steps.PassTimeUntil(CaptureTime(*event));
      Play(*event);
      steps.Settle();
    }
    if (tally_.left_out == tally_.events_in) {
      throw std::runtime_error(log_.file().string() + ": nothing in it to replay; all its " + std::to_string(tally_.events_in) +
                               " messages are of other types or were said by these processes themselves");
    }
    steps.PublishStatus();
    out_.Close();
    tally_.damaged_places = log_.damage().places;
    return tally_;
  }
  const std::vector<std::unique_ptr<Node>>& nodes() const { return nodes_; }

 private:
  static std::int64_t Begin(messaging::LogReader& log) {
    const auto first = log.Next();
    if (!first) throw std::runtime_error(log.file().string() + ": there is nothing in this log");
    log.Rewind();
    return CaptureTime(*first);
  }

  void Play(const messaging::LogEvent& event) {
    playing_ = true;
    bus_.PublishRaw(event.channel, event.data.data(), event.data.size());
    playing_ = false;
  }

  const ReplayOptions& options_;
  messaging::LogReader& log_;
  std::vector<std::string> own_;
  messaging::LogWriter out_;
  messaging::VirtualClock clock_;
  messaging::Bus bus_;
  std::vector<std::unique_ptr<Node>> nodes_;
  Tally tally_;
  bool playing_ = false;
};

void RunReplay(ReplayOptions options) {
  CheckOptions(options);
  for (std::string* path : {&options.common.json, &options.common.config, &options.log, &options.out, &options.configs,
                            &options.store, &options.from_store}) {
    MakeAbsolute(*path);
  }
  messaging::LogReader log(options.log);
  Json result;
  std::ostringstream text;
  {
    const Workplace workplace;
    if (!options.from_store.empty()) CopyStore(options.from_store, kStoreName);
    Tally tally;
    {
      Replay replay(options, log);
      tally = replay.Run();
      for (const auto& node : replay.nodes()) {
        result["processes"][node->process()] = {
            {"gaps", node->gaps()}, {"skipped", node->skipped()}, {"bad", node->bad()}, {"last_error", node->last_error()}};
        if (!node->last_error().empty()) text << node->process() << ": " << node->last_error() << '\n';
      }
    }
    if (!options.store.empty() && fs::exists(kStoreName)) CopyStore(kStoreName, options.store);
    result["events_in"] = tally.events_in;
    result["left_out"] = tally.left_out;
    result["damaged_places"] = tally.damaged_places;
    result["out"] = tally.out;
    text << tally.events_in << " events in, of which " << tally.left_out << " were left out\n";
    for (const auto& [channel, count] : tally.out) text << channel << ": " << count << " messages\n";
    if (tally.damaged_places > 0) text << tally.damaged_places << " damaged places of the log were passed over\n";
  }
  WriteResult(options.common, result, text.str());
}

}  // namespace

void AddReplay(CLI::App& app, Run& run) {
  CLI::App* verb =
      app.add_subcommand("replay", "The real nodes on an LCM log, in lock step: the same log and seed, the same bytes");
  auto options = std::make_shared<ReplayOptions>();
  AddCommonOptions(*verb, options->common);
  verb->add_option("--log,log", options->log, "The LCM log")->required()->type_name("FILE");
  verb->add_option("--out", options->out, "Log of what the nodes say; must not exist yet")->required()->type_name("FILE");
  verb->add_option(
          "--processes", options->processes,
          "Which nodes run; what they said themselves is left out of the log. The mount and the sensor are the log's: they do "
          "not follow a replayed planner, whose commands are only noted")
      ->delimiter(',')
      ->capture_default_str();
  verb->add_option("--process-configs", options->configs,
                   "Folder with learner.yaml, recogniser.yaml, ... as config/; else defaults")
      ->type_name("DIR");
  verb->add_option("--object", options->object, "Name of the object to learn, as of the learner");
  verb->add_option("--from-store", options->from_store, "Begin with a copy of this model store")->type_name("FILE");
  verb->add_option("--store", options->store, "Keep the model store here; must not exist yet")->type_name("FILE");
  verb->add_flag("--every-frame", options->every_frame, "Learner and recogniser look at every frame, whatever their max_rate_hz");
  verb->add_flag("--keep-inputs", options->keep_inputs, "What was played is in the output log too");
  verb->callback([options, &run] { run = [options] { RunReplay(*options); }; });
}

}  // namespace vantage::cli
