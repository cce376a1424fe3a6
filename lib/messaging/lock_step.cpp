#include "messaging/lock_step.h"

#include <algorithm>
#include <stdexcept>

namespace vantage::messaging {
namespace {

constexpr std::int64_t kShortestStep_us = 1000;  // Where a node wants to step at once, again and again.
constexpr int kMaxRounds = 100;
constexpr int kMaxMessages = 1000;  // In one round.

}  // namespace

LockStep::LockStep(VirtualClock& clock, Bus& bus, std::vector<Node*> nodes, const LockStepParams& params)
    : clock_(clock), bus_(bus), nodes_(std::move(nodes)), params_(params), next_status_us_(clock.now_us()) {
  if (params_.status_period_s <= 0.0) next_status_us_ = Node::kNever;
}

void LockStep::Settle() {
  bus_.Drain(kMaxMessages);
  for (int round = 0; round < kMaxRounds; ++round) {
    for (Node* node : nodes_) node->RunStep();
    if (bus_.Drain(kMaxMessages) != Bus::Handled::kMessage) return;
  }
  throw std::runtime_error("the nodes keep answering each other without an end");
}

void LockStep::PublishStatus() {
  for (Node* node : nodes_) node->PublishStatus();
  Settle();
}

void LockStep::PassTimeUntil(std::int64_t utime) {
  const auto max_pause_us = static_cast<std::int64_t>(params_.max_pause_s * 1e6);
  if (utime - clock_.now_us() > max_pause_us) clock_.AdvanceTo(utime - max_pause_us);
  while (true) {
    std::int64_t next_us = next_status_us_;
    for (const Node* node : nodes_) next_us = std::min(next_us, node->NextStep_us());
    next_us = std::max(next_us, clock_.now_us() + kShortestStep_us);
    if (next_us > utime) break;
    clock_.AdvanceTo(next_us);
    if (next_us >= next_status_us_) {
      next_status_us_ = next_us + static_cast<std::int64_t>(params_.status_period_s * 1e6);
      for (Node* node : nodes_) node->PublishStatus();
    }
    Settle();
  }
  clock_.AdvanceTo(utime);
}

}  // namespace vantage::messaging
