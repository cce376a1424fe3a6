#include "vantage/trial_record.h"

#include <fstream>
#include <limits>
#include <stdexcept>

#include "vantage/verb.h"

namespace vantage::cli {
namespace {

Json ToJson(const std::vector<assessment::Proposal>& proposals) {
  Json json = Json::array();
  for (const assessment::Proposal& proposal : proposals) {
    json.push_back({proposal.confidence, proposal.correct, Number(proposal.error_m)});
  }
  return json;
}

std::vector<assessment::Proposal> ProposalsFrom(const Json& json) {
  std::vector<assessment::Proposal> proposals;
  for (const Json& one : json) {
    const double error_m = one.at(2).is_null() ? std::numeric_limits<double>::infinity() : one.at(2).get<double>();
    proposals.push_back({one.at(0).get<double>(), one.at(1).get<bool>(), error_m});
  }
  return proposals;
}

Json ToJson(const std::vector<assessment::Displacement>& displacements) {
  Json json = Json::array();
  for (const assessment::Displacement& one : displacements) json.push_back({one.rotation_rad, one.log2_scale});
  return json;
}

std::vector<assessment::Displacement> DisplacementsFrom(const Json& json) {
  std::vector<assessment::Displacement> displacements;
  for (const Json& one : json) displacements.push_back({one.at(0).get<double>(), one.at(1).get<double>()});
  return displacements;
}

Json ToJson(const assessment::Trial& trial) {
  return {trial.view,    trial.object_shown,  trial.rotation_rad,     trial.log2_scale,    trial.image_noise,
          trial.blur_px, ToJson(trial.alone), ToJson(trial.together), ToJson(trial.others)};
}

assessment::Trial TrialFrom(const Json& json) {
  assessment::Trial trial;
  trial.view = json.at(0).get<int>();
  trial.object_shown = json.at(1).get<bool>();
  trial.rotation_rad = json.at(2).get<double>();
  trial.log2_scale = json.at(3).get<double>();
  trial.image_noise = json.at(4).get<double>();
  trial.blur_px = json.at(5).get<double>();
  trial.alone = ProposalsFrom(json.at(6));
  trial.together = ProposalsFrom(json.at(7));
  trial.others = DisplacementsFrom(json.at(8));
  return trial;
}

}  // namespace

TrialRecord::TrialRecord(std::filesystem::path file, std::string key) : file_(std::move(file)), key_(std::move(key)) {
  CheckWritable(file_);
  std::ifstream stream(file_);
  std::string line;
  while (std::getline(stream, line)) {
    const Json json = Json::parse(line, nullptr, false);
    if (json.is_discarded()) continue;
    try {
      if (json.at("key").get<std::string>() != key_) continue;
      std::vector<assessment::Trial> trials;
      for (const Json& trial : json.at("trials")) trials.push_back(TrialFrom(trial));
      trials_[{json.at("view").get<int>(), json.at("utime").get<std::int64_t>()}] = std::move(trials);
    } catch (const Json::exception&) {
      continue;
    }
  }
}

const std::vector<assessment::Trial>* TrialRecord::Find(int view_id, std::int64_t utime) const {
  const auto found = trials_.find({view_id, utime});
  return found == trials_.end() ? nullptr : &found->second;
}

void TrialRecord::Add(int view_id, std::int64_t utime, const std::vector<assessment::Trial>& trials) {
  Json json = {{"key", key_}, {"view", view_id}, {"utime", utime}, {"trials", Json::array()}};
  for (const assessment::Trial& trial : trials) json["trials"].push_back(ToJson(trial));
  std::ofstream stream(file_, std::ios::app);
  // On a line of its own also where the last one was cut off.
  stream << '\n' << json.dump(-1, ' ', false, Json::error_handler_t::replace) << '\n' << std::flush;
  if (!stream) {
    throw std::runtime_error(file_.string() + ": virtual trials cannot be written; check the folder and the space on its disk");
  }
  trials_[{view_id, utime}] = trials;
}

}  // namespace vantage::cli
