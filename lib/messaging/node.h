// What every process is: it subscribes, does its due work in short steps, and says how it fares once a second.
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "messaging/bus.h"
#include "messaging/frame_link.h"

namespace vantage::messaging {

class Node {
 public:
  static constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();

  // `process`: the process's name in lower case.
  Node(Bus& bus, std::string process);
  virtual ~Node() = default;
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;

  // Does what is due; called after messages were handled and when NextStep_us has come. Exceptions are noted as errors.
  virtual void Step() = 0;
  // When Step wants to be called at the latest (by the bus's clock).
  virtual std::int64_t NextStep_us() const { return kNever; }
  // Whether the process has nothing more to do.
  virtual bool Finished() const { return false; }

  // Sends <PROCESS>_STATUS.
  void PublishStatus();
  // Runs Step; an exception is noted as an error.
  void RunStep();
  // Notes an error, and writes it to stderr where it is another than the last; at most one line a second, which says how many were
  // left out.
  void NoteError(const std::string& error);

  const std::string& process() const { return process_; }
  const std::string& last_error() const { return last_error_; }
  std::int64_t bad() const;
  std::int64_t gaps() const { return gaps_; }
  std::int64_t skipped() const { return skipped_; }

 protected:
  // One word, and a few.
  virtual std::string State() const { return "running"; }
  virtual std::string Detail() const { return ""; }

  template <typename Message>
  void Subscribe(const std::string& channel, std::function<void(const Message&)> handler, int queue = 100) {
    subscriptions_.push_back({channel, &bus_.Subscribe<Message>(channel, std::move(handler), queue), 0});
  }
  // For channels on which one process speaks and time never goes back: older messages are refused, unless they are so old that
  // their sender must have been started again, or a log is played.
  template <typename Message>
  void SubscribeInOrder(const std::string& channel, std::function<void(const Message&)> handler, int queue = 100) {
    Subscribe<Message>(
        channel,
        [this, channel, handler = std::move(handler)](const Message& message) {
          if (InOrder(channel, message.utime)) handler(message);
        },
        queue);
  }
  // Publishes what was made of something captured at message.utime, and notes how long that took.
  template <typename Message>
  void PublishDerived(const std::string& channel, const Message& message) {
    latencies_ms_[channel].push_back(1e-3 * static_cast<double>(bus_.now_us() - message.utime));
    bus_.Publish(channel, message);
  }
  // A message whose values are out of range.
  void Refuse(const std::string& channel, const std::string& why);
  void Count(const std::string& counter, std::int64_t by = 1) { counters_[counter].total += by; }
  // Takes over what the receiver of this node's frames has counted.
  void CountFrames(const FrameReceiver& frames);
  std::int64_t now_us() const { return bus_.now_us(); }

  Bus& bus_;

 private:
  struct Counter {
    std::int64_t total = 0;
    std::int64_t total_at_last_status = 0;
  };
  struct Subscribed {
    std::string channel;
    const SubscriptionCounts* counts;
    std::int64_t bad_seen;
  };

  bool InOrder(const std::string& channel, std::int64_t utime);
  void CollectSubscriptionErrors();
  void SetCount(const std::string& counter, std::int64_t total);

  std::string process_;
  std::vector<Subscribed> subscriptions_;
  std::map<std::string, std::int64_t> refused_by_channel_;
  std::map<std::string, std::int64_t> newest_utime_;         // Of channels that are in order.
  std::map<std::string, std::vector<double>> latencies_ms_;  // Since the last status.
  std::map<std::string, Counter> counters_;
  std::int64_t started_us_ = 0;
  std::int64_t last_status_us_ = 0;
  std::int64_t bad_frames_ = 0;
  std::int64_t gaps_ = 0;
  std::int64_t skipped_ = 0;
  std::string last_error_;
  std::int64_t last_error_us_ = 0;
  std::string last_said_;
  std::int64_t last_said_us_ = 0;
  std::int64_t unsaid_ = 0;
};

}  // namespace vantage::messaging
