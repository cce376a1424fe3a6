#include "messaging/known_types.h"

#include <map>
#include <vantage/answer_t.hpp>
#include <vantage/host_clock_t.hpp>
#include <vantage/object_prior_t.hpp>
#include <vantage/operator_command_t.hpp>
#include <vantage/query_t.hpp>
#include <vantage/status_t.hpp>
#include <vantage/store_list_t.hpp>
#include <vantage/store_query_t.hpp>

#include "messaging/assessor_messages.h"
#include "messaging/channels.h"
#include "messaging/frame_link.h"
#include "messaging/geometry_messages.h"
#include "messaging/learner_messages.h"
#include "messaging/mount_messages.h"
#include "messaging/planner_messages.h"
#include "messaging/store_messages.h"

namespace vantage::messaging {
namespace {

std::string WhyWrong(const image_part_t& part) { return WhyNotAPart(part); }
std::string WhyWrong(const object_prior_t& prior) {
  return prior.probability > 0.0 && prior.probability < 1.0 ? "" : "a prior of " + std::to_string(prior.probability);
}
std::string WhyWrong(const query_t& query) { return FromMessage(query.T_frame_camera).error; }
std::string WhyWrong(const answer_t& answer) { return IsProbability(answer.probability) ? "" : "a probability out of range"; }
std::string WhyWrong(const status_t&) { return ""; }
std::string WhyWrong(const operator_command_t&) { return ""; }
std::string WhyWrong(const host_clock_t& clock) { return clock.host.empty() ? "a clock of no host" : ""; }
std::string WhyWrong(const store_query_t&) { return ""; }
std::string WhyWrong(const store_list_t&) { return ""; }
std::string WhyWrong(const store_part_t& part) { return WhyNotAPart(part); }
std::string WhyWrong(const plan_t& plan) { return IsProbability(plan.completeness) ? "" : "a completeness out of range"; }
template <typename Message>
std::string WhyWrong(const Message& message) {
  return FromMessage(message).error;
}

template <typename Message>
std::string WhyBad(const void* data, std::size_t size) {
  const int bytes = static_cast<int>(size);
  if (!PlausibleBytes<Message>(data, static_cast<std::uint32_t>(size))) return "its sizes are wrong";
  try {
    Message message;
    const int used = message.decode(data, 0, bytes);
    if (used < 0) return "it is cut off";
    if (used != bytes) return std::to_string(bytes - used) + " bytes too many";
    return WhyWrong(message);
  } catch (const std::exception&) {  // A count that is negative, or more than there is memory for.
    return "its sizes are wrong";
  }
}

struct KnownType {
  std::string name;
  std::string (*why_bad)(const void* data, std::size_t size) = nullptr;
};
using KnownTypes = std::map<std::int64_t, KnownType>;  // By fingerprint.

template <typename... Message>
KnownTypes MakeKnownTypes() {
  return {{Message::getHash(), {Message::getTypeName(), WhyBad<Message>}}...};
}

const KnownType* Find(const void* data, std::size_t size) {
  static const KnownTypes types =
      MakeKnownTypes<answer_t, completeness_t, detections_t, host_clock_t, image_part_t, measures_t, mount_command_t, mount_state_t,
                     object_prior_t, operator_command_t, plan_t, query_t, reach_t, scene_t, status_t, store_list_t, store_part_t,
                     store_query_t, track_t, view_t>();
  if (size < 16) return nullptr;  // Fingerprint and utime.
  std::int64_t fingerprint = 0;
  __int64_t_decode_array(data, 0, 8, &fingerprint, 1);
  const auto known = types.find(fingerprint);
  return known == types.end() ? nullptr : &known->second;
}

bool EndsWith(const std::string& text, const std::string& end) {
  return text.size() > end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

}  // namespace

std::string TypeOf(const void* data, std::size_t size) {
  const KnownType* type = Find(data, size);
  return type ? type->name : "";
}

std::string TypeOfChannel(const std::string& channel) {
  static const std::map<std::string, std::string> types = {{kSensorColor, "image_part_t"},
                                                           {kSensorDepth, "image_part_t"},
                                                           {kMountState, "mount_state_t"},
                                                           {kMountCommand, "mount_command_t"},
                                                           {kLearnerTrack, "track_t"},
                                                           {kLearnerScene, "scene_t"},
                                                           {kLearnerView, "view_t"},
                                                           {kRecogniserDetections, "detections_t"},
                                                           {kAssessorMeasures, "measures_t"},
                                                           {kAssessorCompleteness, "completeness_t"},
                                                           {kAssessorQuery, "query_t"},
                                                           {kAssessorAnswer, "answer_t"},
                                                           {kPlannerPlan, "plan_t"},
                                                           {kPlannerReach, "reach_t"},
                                                           {kOperatorCommand, "operator_command_t"},
                                                           {kObjectPrior, "object_prior_t"},
                                                           {kLinkClock, "host_clock_t"},
                                                           {kLinkQuery, "store_query_t"},
                                                           {kLinkList, "store_list_t"},
                                                           {kLinkPart, "store_part_t"}};
  const auto known = types.find(channel);
  if (known != types.end()) return known->second;
  return EndsWith(channel, "_STATUS") ? "status_t" : "";
}

std::optional<std::int64_t> UtimeOf(const void* data, std::size_t size) {
  if (!Find(data, size)) return std::nullopt;
  std::int64_t utime = 0;
  __int64_t_decode_array(data, 8, 8, &utime, 1);
  return utime;
}

std::string WhyRefused(const std::string& channel, const void* data, std::size_t size) {
  const std::string expected = TypeOfChannel(channel);
  if (expected.empty()) return "";
  const KnownType* type = Find(data, size);
  if (!type) return "a message of an unknown type instead of " + expected;
  if (type->name != expected) return "a " + type->name + " instead of " + expected;
  const std::string why = type->why_bad(data, size);
  return why.empty() ? "" : expected + ": " + why;
}

}  // namespace vantage::messaging
