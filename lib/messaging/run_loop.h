// Runs nodes on a bus until they are finished or a signal comes.
#pragma once

#include <functional>
#include <vector>

#include "messaging/bus.h"
#include "messaging/node.h"

namespace vantage::messaging {

// While one is alive, SIGINT and SIGTERM are remembered instead of ending the program. One at a time.
class StopSignals {
 public:
  StopSignals();  // Throws std::logic_error where there is one already.
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  bool Raised() const;
  int file_descriptor() const;  // Readable once a signal came.
};

enum class RunEnd { kSignal, kFinished, kBusEnded, kCondition };

struct RunParams {
  double status_period_s = 1.0;       // <= 0: no status.
  std::function<bool()> until;        // Ends the run where it returns true; asked every turn; may be empty.
  std::int64_t max_wait_us = 200000;  // A turn takes no longer where nothing happens.
};

// Drains the bus at once every turn, so that nothing piles up in LCM's queue (which drops the newest), then lets every node step.
// Ends when every node is finished, a signal came, the log ended, or `until` says so. `signals` may be null.
RunEnd RunNodes(Bus& bus, const std::vector<Node*>& nodes, const StopSignals* signals, const RunParams& params = {});

}  // namespace vantage::messaging
