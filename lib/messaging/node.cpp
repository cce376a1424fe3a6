#include "messaging/node.h"

#include <cstdio>
#include <vantage/status_t.hpp>

#include "messaging/channels.h"

namespace vantage::messaging {

Node::Node(Bus& bus, std::string process)
    : bus_(bus), process_(std::move(process)), started_us_(bus.now_us()), last_status_us_(started_us_) {}

void Node::NoteError(const std::string& error) {
  if (error != last_error_) std::fprintf(stderr, "%s: %s\n", process_.c_str(), error.c_str());
  last_error_ = error;
  last_error_us_ = bus_.now_us();
}

void Node::Refuse(const std::string& channel, const std::string& why) {
  ++refused_;
  NoteError(channel + ": " + why);
}

std::int64_t Node::bad() const {
  std::int64_t bad = refused_ + bad_frames_;
  for (const auto* counts : subscriptions_) bad += counts->bad;
  return bad;
}

void Node::CountFrames(const FrameReceiver& frames) {
  gaps_ = frames.gaps();
  skipped_ = frames.skipped();
  if (frames.bad() > bad_frames_) NoteError(frames.last_error());
  bad_frames_ = frames.bad();
}

void Node::CollectSubscriptionErrors() {
  bad_seen_.resize(subscriptions_.size(), 0);
  for (std::size_t i = 0; i < subscriptions_.size(); ++i) {
    if (subscriptions_[i]->bad > bad_seen_[i]) NoteError(subscriptions_[i]->last_error);
    bad_seen_[i] = subscriptions_[i]->bad;
  }
}

void Node::RunStep() {
  CollectSubscriptionErrors();
  try {
    Step();
  } catch (const std::exception& error) {
    NoteError(error.what());
  }
}

void Node::PublishStatus() {
  CollectSubscriptionErrors();
  status_t status;
  status.utime = bus_.now_us();
  status.process = process_;
  status.state = State();
  status.detail = Detail();
  status.uptime_s = 1e-6 * static_cast<double>(status.utime - started_us_);
  status.gaps = gaps_;
  status.skipped = skipped_;
  status.bad = bad();
  status.last_error = last_error_;
  status.last_error_utime = last_error_us_;
  const double elapsed_s = 1e-6 * static_cast<double>(status.utime - last_status_us_);
  for (auto& [name, counter] : counters_) {
    counter_t entry;
    entry.name = name;
    entry.total = counter.total;
    entry.rate_hz = elapsed_s > 0.0 ? static_cast<double>(counter.total - counter.total_at_last_status) / elapsed_s : 0.0;
    counter.total_at_last_status = counter.total;
    status.counters.push_back(entry);
  }
  status.count = static_cast<std::int16_t>(status.counters.size());
  last_status_us_ = status.utime;
  bus_.Publish(StatusChannel(process_), status);
}

}  // namespace vantage::messaging
