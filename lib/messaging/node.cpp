#include "messaging/node.h"

#include <algorithm>
#include <cstdio>
#include <vantage/status_t.hpp>

#include "messaging/channels.h"

namespace vantage::messaging {
namespace {

constexpr std::int64_t kWarningPeriod_us = 1000000;

}  // namespace

Node::Node(Bus& bus, std::string process)
    : bus_(bus), process_(std::move(process)), started_us_(bus.now_us()), last_status_us_(started_us_) {}

void Node::NoteError(const std::string& error) {
  last_error_ = error;
  last_error_us_ = bus_.now_us();
  if (error == last_said_) return;
  if (!last_said_.empty() && last_error_us_ >= last_said_us_ && last_error_us_ < last_said_us_ + kWarningPeriod_us) {
    ++unsaid_;
    return;
  }
  const std::string others = unsaid_ > 0 ? " (and " + std::to_string(unsaid_) + " other warnings before it)" : "";
  std::fprintf(stderr, "%s: %s%s\n", process_.c_str(), error.c_str(), others.c_str());
  last_said_ = error;
  last_said_us_ = last_error_us_;
  unsaid_ = 0;
}

void Node::Refuse(const std::string& channel, const std::string& why) {
  ++refused_by_channel_[channel];
  NoteError(channel + ": " + why);
}

std::int64_t Node::bad() const {
  std::int64_t bad = bad_frames_;
  for (const auto& [channel, refused] : refused_by_channel_) bad += refused;
  for (const auto& subscribed : subscriptions_) bad += subscribed.counts->bad;
  return bad;
}

void Node::CountFrames(const FrameReceiver& frames) {
  gaps_ = frames.gaps();
  skipped_ = frames.skipped();
  if (frames.bad() > bad_frames_) NoteError(frames.last_error());
  bad_frames_ = frames.bad();
  SetCount(std::string("lost ") + kSensorColor, frames.lost_colors());
  SetCount(std::string("lost ") + kSensorDepth, frames.lost_depths());
  SetCount(std::string("bad ") + kSensorColor, frames.bad_colors());
  SetCount(std::string("bad ") + kSensorDepth, frames.bad_depths());
}

void Node::SetCount(const std::string& counter, std::int64_t total) {
  if (total > 0) counters_[counter].total = total;
}

bool Node::InOrder(const std::string& channel, std::int64_t utime) {
  std::int64_t& newest = newest_utime_[channel];
  if (utime < newest && newest - utime <= kMaxLateness_us) {
    Refuse(channel, "utime goes backwards by " + std::to_string(newest - utime) + " us");
    return false;
  }
  newest = utime;
  return true;
}

void Node::CollectSubscriptionErrors() {
  for (auto& subscribed : subscriptions_) {
    if (subscribed.counts->bad > subscribed.bad_seen) NoteError(subscribed.counts->last_error);
    subscribed.bad_seen = subscribed.counts->bad;
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
  std::map<std::string, std::int64_t> bad_by_channel = refused_by_channel_;
  for (const auto& subscribed : subscriptions_) bad_by_channel[subscribed.channel] += subscribed.counts->bad;
  for (const auto& [channel, count] : bad_by_channel) SetCount("bad " + channel, count);
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
  for (auto& [channel, ms] : latencies_ms_) {
    latency_t entry;
    entry.channel = channel;
    entry.messages = static_cast<std::int32_t>(ms.size());
    std::sort(ms.begin(), ms.end());
    entry.median_ms = ms.empty() ? 0.0 : ms[ms.size() / 2];
    entry.max_ms = ms.empty() ? 0.0 : ms.back();
    ms.clear();
    status.latencies.push_back(entry);
  }
  status.latency_count = static_cast<std::int16_t>(status.latencies.size());
  last_status_us_ = status.utime;
  bus_.Publish(StatusChannel(process_), status);
}

}  // namespace vantage::messaging
