#include "exploration/planner.h"

#include <cmath>
#include <stdexcept>

namespace vantage::exploration {

void PlannerParams::Check() const {
  const auto require = [](bool good, const char* field, const char* wanted, double value) {
    if (!good) throw std::invalid_argument(std::string(field) + " must be " + wanted + ", is " + std::to_string(value));
  };
  require(worth_s > 0.0, "worth_s", "> 0", worth_s);
  require(target_completeness > 0.0 && target_completeness <= 1.0, "target_completeness", "in (0, 1]", target_completeness);
  require(min_detect_probability >= 0.0 && min_detect_probability < 1.0, "min_detect_probability", "in [0, 1)",
          min_detect_probability);
  require(std::isfinite(attempt_log_odds), "attempt_log_odds", "finite", attempt_log_odds);
  require(min_view_angle_rad >= 0.0, "min_view_angle_rad", ">= 0", min_view_angle_rad);
  require(t_plan_s >= 0.0, "t_plan_s", ">= 0", t_plan_s);
  require(t_learn_s >= 0.0, "t_learn_s", ">= 0", t_learn_s);
  require(time_budget_s > 0.0, "time_budget_s", "> 0", time_budget_s);
  require(max_attempts >= 1, "max_attempts", ">= 1", max_attempts);
  require(failure_radius_rad >= 0.0, "failure_radius_rad", ">= 0", failure_radius_rad);
  require(failure_discount >= 0.0 && failure_discount < 1.0, "failure_discount", "in [0, 1)", failure_discount);
  require(max_path_goals >= 1, "max_path_goals", ">= 1", max_path_goals);
}

std::string ToString(StopReason reason) {
  switch (reason) {
    case StopReason::kTargetReached:
      return "target_reached";
    case StopReason::kNothingWorthwhile:
      return "nothing_worth_its_cost";
    case StopReason::kNothingReachable:
      return "nothing_reachable";
    case StopReason::kTimeBudget:
      return "time_budget";
    case StopReason::kMaxAttempts:
      return "max_attempts";
    case StopReason::kOperator:
      return "operator";
    case StopReason::kNone:
      break;
  }
  return "none";
}

}  // namespace vantage::exploration
