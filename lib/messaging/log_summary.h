// What a log holds, channel by channel, and what is wrong with it.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "messaging/log.h"

namespace vantage::messaging {

struct ChannelSummary {
  std::string type;              // Of its messages; "unknown" where it is none of ours, "several" where they differ.
  std::int64_t messages = 0;     // For images: parts.
  std::int64_t images = 0;       // Whole ones, on channels of images.
  std::int64_t lost_images = 0;  // Sequence numbers that are left out, and images of which parts are missing.
  std::int64_t bytes = 0;
  std::int64_t largest_bytes = 0;
  std::int64_t first_us = 0;  // When the first and the last were heard.
  std::int64_t last_us = 0;
  std::int64_t longest_pause_us = 0;  // Between two messages.
  std::int64_t refused = 0;           // Our nodes would not take them.
  std::int64_t backwards = 0;         // utime smaller than that of the message before.
  std::string first_refusal;

  // Messages (on channels of images: images) per second; 0 where there are fewer than two.
  double rate_hz() const;
};

struct LogSummary {
  std::map<std::string, ChannelSummary> channels;
  std::int64_t events = 0;
  std::int64_t first_us = 0;
  std::int64_t last_us = 0;
  std::int64_t late_events = 0;   // Dated before an event that stands before them...
  std::int64_t most_late_us = 0;  // ...by so much at most.
  LogDamage damage;

  double duration_s() const { return 1e-6 * static_cast<double>(last_us - first_us); }
  // lcm-logger dates a message by its fragments but writes it when it is whole: 43 ms out of order in 5 minutes on a busy machine.
  // So little is no fault.
  static constexpr std::int64_t kLoggerDisorder_us = 500000;
  // One line for everything that is wrong; empty where nothing is. Channels that are not ours are named, and are no
  // fault unless there are no others.
  std::vector<std::string> Problems() const;
  std::vector<std::string> UnknownChannels() const;
};

// Reads the whole log from its beginning. Memory does not grow with its length. Throws what LogReader throws.
LogSummary Summarise(LogReader& log);

}  // namespace vantage::messaging
