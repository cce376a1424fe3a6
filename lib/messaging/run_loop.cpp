#include "messaging/run_loop.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <stdexcept>

namespace vantage::messaging {
namespace {

// A signal handler can reach globals only.
int pipe_ends[2] = {-1, -1};
std::atomic<bool> raised{false};
struct sigaction old_interrupt;
struct sigaction old_terminate;

void OnSignal(int) {
  const int saved = errno;
  raised = true;
  const char byte = 1;
  [[maybe_unused]] const ssize_t written = write(pipe_ends[1], &byte, 1);
  errno = saved;
}

bool Waiting(const Bus& bus, const StopSignals* signals, std::int64_t wait_us) {
  pollfd fds[2] = {{bus.file_descriptor(), POLLIN, 0}, {signals ? signals->file_descriptor() : -1, POLLIN, 0}};
  const int timeout_ms = static_cast<int>((wait_us + 999) / 1000);
  poll(fds, 2, timeout_ms);  // A signal or an error only ends the wait early.
  return (fds[0].revents & POLLIN) != 0;
}

}  // namespace

StopSignals::StopSignals() {
  if (pipe_ends[0] >= 0) throw std::logic_error("two StopSignals at once");
  if (pipe2(pipe_ends, O_CLOEXEC | O_NONBLOCK) != 0) throw std::runtime_error("cannot make a pipe for signals");
  raised = false;
  struct sigaction action = {};
  action.sa_handler = OnSignal;
  sigaction(SIGINT, &action, &old_interrupt);
  sigaction(SIGTERM, &action, &old_terminate);
}

StopSignals::~StopSignals() {
  sigaction(SIGINT, &old_interrupt, nullptr);
  sigaction(SIGTERM, &old_terminate, nullptr);
  close(pipe_ends[0]);
  close(pipe_ends[1]);
  pipe_ends[0] = pipe_ends[1] = -1;
}

bool StopSignals::Raised() const { return raised; }
int StopSignals::file_descriptor() const { return pipe_ends[0]; }

RunEnd RunNodes(Bus& bus, const std::vector<Node*>& nodes, const StopSignals* signals, const RunParams& params) {
  const auto period_us = static_cast<std::int64_t>(params.status_period_s * 1e6);
  std::int64_t next_status_us = bus.now_us();
  while (true) {
    if (signals && signals->Raised()) return RunEnd::kSignal;
    if (params.until && params.until()) return RunEnd::kCondition;

    for (Node* node : nodes) node->RunStep();
    const std::int64_t now_us = bus.now_us();
    if (period_us > 0 && now_us >= next_status_us) {
      for (Node* node : nodes) node->PublishStatus();
      next_status_us = now_us + period_us;
    }
    if (std::all_of(nodes.begin(), nodes.end(), [](const Node* node) { return node->Finished(); })) {
      for (Node* node : nodes) node->PublishStatus();
      return RunEnd::kFinished;
    }

    std::int64_t wake_us = std::min(now_us + params.max_wait_us, period_us > 0 ? next_status_us : Node::kNever);
    for (const Node* node : nodes) wake_us = std::min(wake_us, node->NextStep_us());
    if (Waiting(bus, signals, std::clamp<std::int64_t>(wake_us - bus.now_us(), 0, params.max_wait_us)) &&
        bus.Drain() == Bus::Handled::kEnd) {
      return RunEnd::kBusEnded;
    }
  }
}

}  // namespace vantage::messaging
