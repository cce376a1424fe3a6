#include "messaging/planner_messages.h"

#include <algorithm>
#include <cmath>

#include "messaging/assessor_messages.h"
#include "messaging/bus.h"
#include "messaging/geometry_messages.h"

namespace vantage::messaging {
namespace {

void AddPath(const motion::Trajectory& path, int max_points, candidate_t& message) {
  const int points = std::min<int>(max_points, static_cast<int>(path.waypoints.size()));
  for (int i = 0; i < points; ++i) {
    const double time_s = points > 1 ? path.duration_s() * i / (points - 1) : 0.0;
    const Eigen::Vector3f position = path.At(time_s).translation().cast<float>();
    message.path.push_back({position.x(), position.y(), position.z()});
  }
  message.count = static_cast<std::int16_t>(message.path.size());
}

candidate_t CandidateMessage(const exploration::Candidate& candidate, int max_path_points) {
  candidate_t message;
  message.id = candidate.view.id;
  message.T_world_camera = ToMessage(candidate.view.T_world_camera);
  message.viewpoint = ToMessage(candidate.view.viewpoint);
  message.detect_probability = candidate.detect_probability;
  message.gain = candidate.gain;
  message.t_plan_s = candidate.t_plan_s;
  message.t_move_s = candidate.t_move_s;
  message.t_learn_s = candidate.t_learn_s;
  message.utility_s = std::isfinite(candidate.utility_s) ? candidate.utility_s : 0.0;
  message.refusal = candidate.refusal;
  message.count = 0;
  if (candidate.path) AddPath(*candidate.path, max_path_points, message);
  return message;
}

}  // namespace

plan_t ToMessage(const PlanStatus& status, const exploration::Decision* decision, int max_path_points) {
  plan_t message;
  message.utime = status.utime;
  message.run_id = status.run_id;
  message.object = status.object;
  message.state = status.state;
  message.decision = status.decision;
  message.completeness = status.completeness;
  message.target_completeness = status.target_completeness;
  message.elapsed_s = status.elapsed_s;
  message.attempts = status.attempts;
  message.failed_attempts = status.failed_attempts;
  message.views = status.views;
  message.stop_reason = status.stop_reason;
  message.chosen = decision ? decision->chosen : -1;
  message.command_id = status.command_id;
  if (decision) {
    for (const auto& candidate : decision->candidates) message.candidates.push_back(CandidateMessage(candidate, max_path_points));
  }
  message.count = static_cast<std::int16_t>(message.candidates.size());
  if (max_path_points > 0 && message.getEncodedSize() > kMaxMessageBytes) return ToMessage(status, decision, 0);
  return message;
}

}  // namespace vantage::messaging
