// What the planner says, on the wire.
#pragma once

#include <cstdint>
#include <string>
#include <vantage/plan_t.hpp>

#include "exploration/planner.h"

namespace vantage::messaging {

// How a run stands.
struct PlanStatus {
  std::int64_t utime = 0;
  std::int64_t run_id = 0;  // utime at which the planner started its run.
  std::string object;
  std::string state;
  int decision = 0;  // Counts decisions, from 1.
  double completeness = 0.0;
  double target_completeness = 1.0;
  double elapsed_s = 0.0;
  int attempts = 0;
  int failed_attempts = 0;
  int views = 0;
  std::string stop_reason;       // Empty while it goes on.
  std::int64_t command_id = -1;  // Of the way to the chosen view.
};

// `decision` may be null. Of every path at most `max_path_points` points are sent, and none where the message would be too large.
plan_t ToMessage(const PlanStatus& status, const exploration::Decision* decision, int max_path_points = 12);

}  // namespace vantage::messaging
