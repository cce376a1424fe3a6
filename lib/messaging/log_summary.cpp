#include "messaging/log_summary.h"

#include <algorithm>
#include <optional>
#include <vantage/image_part_t.hpp>

#include "messaging/frame_link.h"
#include "messaging/known_types.h"

namespace vantage::messaging {
namespace {

// Follows the sequence numbers of one channel of images. The last image may just have been on its way: it is not lost.
class ImageCounter {
 public:
  void Add(const image_part_t& part, ChannelSummary& summary) {
    if (sequence_ != part.sequence) {
      // The first may have been under way when the log began.
      if (sequence_ && !whole_ && !first_) ++summary.lost_images;
      first_ = !sequence_;
      whole_ = false;
      // A sequence that starts again is a sensor that did.
      if (sequence_ && part.sequence > *sequence_) summary.lost_images += part.sequence - *sequence_ - 1;
      sequence_ = part.sequence;
      parts_.clear();
      wanted_ = part.parts;
    }
    parts_.insert(part.part);
    if (!whole_ && static_cast<int>(parts_.size()) == wanted_) {
      whole_ = true;
      ++summary.images;
    }
  }

 private:
  std::optional<std::int64_t> sequence_;
  std::set<int> parts_;
  int wanted_ = 0;
  bool whole_ = false;
  bool first_ = false;
};

struct Followed {
  std::optional<std::int64_t> utime;
  ImageCounter images;
};

void Count(const LogEvent& event, ChannelSummary& summary, Followed& followed) {
  const auto size = static_cast<std::int64_t>(event.data.size());
  std::string type = TypeOf(event.data.data(), event.data.size());
  if (type.empty()) type = "unknown";
  summary.type = summary.messages == 0 || summary.type == type ? type : "several";
  if (summary.messages == 0) summary.first_us = event.time_us;
  if (summary.messages > 0) summary.longest_pause_us = std::max(summary.longest_pause_us, event.time_us - summary.last_us);
  summary.last_us = event.time_us;
  ++summary.messages;
  summary.bytes += size;
  summary.largest_bytes = std::max(summary.largest_bytes, size);

  const std::string why = WhyRefused(event.channel, event.data.data(), event.data.size());
  if (!why.empty()) {
    ++summary.refused;
    if (summary.first_refusal.empty()) summary.first_refusal = why;
    return;
  }
  if (const auto utime = UtimeOf(event.data.data(), event.data.size())) {
    if (followed.utime && *utime < *followed.utime) ++summary.backwards;
    followed.utime = utime;
  }
  if (TypeOfChannel(event.channel) == "image_part_t") {
    image_part_t part;
    if (part.decode(event.data.data(), 0, static_cast<int>(size)) >= 0) followed.images.Add(part, summary);
  }
}

std::string Times(std::int64_t count, const std::string& one, const std::string& many) {
  return std::to_string(count) + " " + (count == 1 ? one : many);
}

}  // namespace

double ChannelSummary::rate_hz() const {
  const std::int64_t count = type == "image_part_t" ? images : messages;
  return count > 1 && last_us > first_us ? 1e6 * static_cast<double>(count - 1) / static_cast<double>(last_us - first_us) : 0.0;
}

std::vector<std::string> LogSummary::UnknownChannels() const {
  std::vector<std::string> names;
  for (const auto& [name, channel] : channels) {
    if (TypeOfChannel(name).empty()) names.push_back(name);
  }
  return names;
}

std::vector<std::string> LogSummary::Problems() const {
  std::vector<std::string> problems;
  if (events == 0) {
    problems.push_back("there is nothing in this log");
  } else if (UnknownChannels().size() == channels.size()) {
    problems.push_back("none of its " + Times(events, "message", "messages") + " is on a channel of ours");
  }
  if (damage.places > 0) {
    problems.push_back(Times(damage.places, "damaged place", "damaged places") + ", " + std::to_string(damage.skipped_bytes) +
                       " bytes passed over, the first at byte " + std::to_string(damage.first_offset) +
                       (damage.cut_off ? "; the log is cut off at its end" : ""));
  }
  if (most_late_us > kLoggerDisorder_us) {
    problems.push_back(Times(late_events, "event", "events") + " out of the order of time, by " +
                       std::to_string(most_late_us / 1000) + " ms at most");
  }
  for (const auto& [name, channel] : channels) {
    if (channel.refused > 0) {
      problems.push_back(name + ": " + Times(channel.refused, "message", "messages") +
                         " that our nodes refuse, the first: " + channel.first_refusal);
    }
    if (channel.lost_images > 0) problems.push_back(name + ": " + Times(channel.lost_images, "image", "images") + " lost");
    if (channel.backwards > 0) {
      problems.push_back(name + ": utime goes backwards " + Times(channel.backwards, "time", "times"));
    }
  }
  return problems;
}

LogSummary Summarise(LogReader& log) {
  log.Rewind();
  LogSummary summary;
  std::map<std::string, Followed> followed;
  while (const auto event = log.Next()) {
    if (summary.events == 0) summary.first_us = event->time_us;
    if (summary.events > 0 && event->time_us < summary.last_us) {
      ++summary.late_events;
      summary.most_late_us = std::max(summary.most_late_us, summary.last_us - event->time_us);
    }
    summary.last_us = std::max(summary.last_us, event->time_us);
    ++summary.events;
    Count(*event, summary.channels[event->channel], followed[event->channel]);
  }
  summary.damage = log.damage();
  return summary;
}

}  // namespace vantage::messaging
