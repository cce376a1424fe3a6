// How far the clocks of other hosts are off ours, from messages that cross the bus in both directions.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <vantage/host_clock_t.hpp>
#include <vector>

namespace vantage::messaging {

struct ClockOffset {
  std::string host;
  double offset_ms = 0.0;     // Its clock less ours.
  double delay_ms = 0.0;      // There and back; the offset is right to half of it.
  std::int64_t heard_us = 0;  // When it was heard last, our clock.
};

// One host's end. Not thread-safe.
class HostClocks {
 public:
  explicit HostClocks(std::string host);  // Throws std::invalid_argument where it is empty.

  // What to send now, about once a second.
  host_clock_t Say(std::int64_t now_us);
  // With the time it came, our clock. Our own messages are passed over.
  void Hear(const host_clock_t& message, std::int64_t received_us);

  // Of the hosts heard in the last 10 s and whose echo of ours was heard: of the last 8 exchanges the one that was on its way least
  // (Mills, RFC 5905: offset = ((t2 - t1) + (t3 - t4)) / 2). By host.
  std::vector<ClockOffset> Offsets(std::int64_t now_us) const;

 private:
  struct Exchange {
    double offset_us = 0.0;
    double delay_us = 0.0;
  };
  struct Other {
    std::int64_t sent_us = 0;      // Of its newest message, its clock.
    std::int64_t received_us = 0;  // Of that, our clock.
    std::deque<Exchange> exchanges;
  };

  std::string host_;
  std::map<std::string, Other> others_;
};

}  // namespace vantage::messaging
