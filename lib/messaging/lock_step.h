// Nodes in one program, fed message by message on a clock of their own: no message is lost and nothing depends on the machine.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "messaging/bus.h"
#include "messaging/node.h"

namespace vantage::messaging {

// Time that passes only when somebody says so. Microseconds since the epoch.
class VirtualClock {
 public:
  explicit VirtualClock(std::int64_t begin_us = 0) : now_us_(begin_us) {}
  std::int64_t now_us() const { return now_us_; }
  void AdvanceTo(std::int64_t utime) { now_us_ = std::max(now_us_, utime); }
  Bus::Clock AsClock() const {
    return [this] { return now_us_; };
  }

 private:
  std::int64_t now_us_;
};

struct LockStepParams {
  double status_period_s = 1.0;  // <= 0: no status.
  double max_pause_s = 60.0;     // A longer pause is passed over at once; > 0.
};

// Runs nodes that share a bus (memq://) on `clock`. After every message and at every time a node asked for, all nodes step, in the
// order given, until nobody has anything more to say. All must outlive it.
class LockStep {
 public:
  LockStep(VirtualClock& clock, Bus& bus, std::vector<Node*> nodes, const LockStepParams& params = {});

  // Lets time pass: nodes step when they want to, and send their status.
  void PassTimeUntil(std::int64_t utime);
  // Nodes deal with what is on the bus. Throws std::runtime_error where they never come to an end with it.
  void Settle();
  // Every node says how it fares.
  void PublishStatus();

 private:
  VirtualClock& clock_;
  Bus& bus_;
  std::vector<Node*> nodes_;
  LockStepParams params_;
  std::int64_t next_status_us_ = 0;
};

}  // namespace vantage::messaging
