#include "link/node.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <random>
#include <stdexcept>

#include "messaging/channels.h"

namespace vantage::link {
namespace {

constexpr std::size_t kMostWaiting = 1500;  // Parts: 270 MB.

std::string HostName() {
  char name[256] = {};
  ::gethostname(name, sizeof name - 1);
  return *name ? name : "host";
}

}  // namespace

void LinkParams::Check() const {
  if (!(period_s > 0.0 && period_s <= 60.0)) throw std::invalid_argument("period_s must be in (0, 60]");
  if (!(part_pause_s >= 0.0 && part_pause_s <= 1.0)) throw std::invalid_argument("part_pause_s must be in [0, 1]");
  if (!(patience_s > 0.0)) throw std::invalid_argument("patience_s must be > 0");
  if (!offer.empty() && !copy.empty()) throw std::invalid_argument("offer and copy: a host either has the store or copies it");
}

LinkParams LoadLinkParams(const std::string& file) {
  LinkParams params;
  if (file.empty()) return params;
  auto yaml = config::Mapping::Load(file);
  yaml.Get("host", params.host);
  yaml.Get("offer", params.offer);
  yaml.Get("copy", params.copy);
  yaml.Get("period_s", params.period_s);
  yaml.Get("part_pause_s", params.part_pause_s);
  yaml.Get("patience_s", params.patience_s);
  yaml.Finish();
  yaml.Check(params);
  return params;
}

LinkNode::LinkNode(messaging::Bus& bus, const LinkParams& params)
    : Node(bus, "link"), params_(params), clocks_(params.host.empty() ? HostName() : params.host) {
  params_.Check();
  if (params_.host.empty()) params_.host = HostName();
  // Requests of other copies, also of one before a restart, are others.
  next_request_ = static_cast<std::int64_t>(std::random_device{}()) << 20;
  Subscribe<host_clock_t>(messaging::kLinkClock, [this](const host_clock_t& message) { clocks_.Hear(message, now_us()); });
  if (!params_.offer.empty()) {
    offer_.emplace(params_.offer);
    Subscribe<store_query_t>(messaging::kLinkQuery, [this](const store_query_t& query) { OnQuery(query); });
  }
  if (!params_.copy.empty()) {
    copy_.emplace(params_.copy);
    Subscribe<store_list_t>(messaging::kLinkList, [this](const store_list_t& list) { OnList(list); });
    Subscribe<store_part_t>(messaging::kLinkPart, [this](const store_part_t& part) { OnPart(part); });
  }
}

void LinkNode::Step() {
  const std::int64_t now = now_us();
  if (now >= next_say_us_) {
    next_say_us_ = now + static_cast<std::int64_t>(params_.period_s * 1e6);
    bus_.Publish(messaging::kLinkClock, clocks_.Say(now));
    if (awaited_ && now - awaited_->last_us > static_cast<std::int64_t>(params_.patience_s * 1e6)) {
      awaited_.reset();
      Count("asked again");
    }
    if (copy_ && !awaited_)
      bus_.Publish(messaging::kLinkQuery, [now] {
        store_query_t query;
        query.utime = now;
        query.request = 0;
        query.count = 0;
        return query;
      }());
  }
  if (!outgoing_.empty() && now >= next_part_us_) {
    next_part_us_ = now + static_cast<std::int64_t>(params_.part_pause_s * 1e6);
    outgoing_.front().utime = now;
    bus_.Publish(messaging::kLinkPart, outgoing_.front());
    outgoing_.pop_front();
    Count("parts");
  }
}

std::int64_t LinkNode::NextStep_us() const { return outgoing_.empty() ? next_say_us_ : std::min(next_say_us_, next_part_us_); }

std::string LinkNode::Detail() const {
  std::string text;
  for (const auto& other : clocks_.Offsets(now_us())) {
    char line[120];
    std::snprintf(line, sizeof line, "%s%.60s %+.2f ms (%.2f ms on the way)", text.empty() ? "" : ", ", other.host.c_str(),
                  other.offset_ms, other.delay_ms);
    text += line;
  }
  return text.empty() ? "no other host" : text;
}

void LinkNode::OnQuery(const store_query_t& query) {
  if (query.object.empty()) {
    bus_.Publish(messaging::kLinkList, offer_->List(params_.host, now_us()));
    return;
  }
  // Who asks twice has not got the first answer.
  const bool waiting =
      std::any_of(outgoing_.begin(), outgoing_.end(), [&](const auto& part) { return part.request == query.request; });
  if (waiting) return;
  try {
    for (auto& part : offer_->Answer(query)) outgoing_.push_back(std::move(part));
  } catch (const std::exception& error) {
    NoteError(params_.offer + ": " + error.what());
  }
  if (outgoing_.size() > kMostWaiting) outgoing_.clear();
}

void LinkNode::OnList(const store_list_t& list) {
  if (awaited_) return;
  try {
    if (auto query = copy_->Compare(list)) Ask(std::move(*query));
  } catch (const std::exception& error) {
    NoteError(params_.copy + ": " + error.what());
  }
}

void LinkNode::Ask(store_query_t query) {
  query.utime = now_us();
  query.request = ++next_request_;
  awaited_.emplace();
  awaited_->request = query.request;
  awaited_->last_us = query.utime;
  bus_.Publish(messaging::kLinkQuery, query);
}

void LinkNode::OnPart(const store_part_t& part) {
  if (!awaited_ || part.request != awaited_->request) return;
  awaited_->last_us = now_us();
  auto added = awaited_->parts.Add(part);
  if (!added) return Refuse(messaging::kLinkPart, added.error);
  if (!*added) return;
  awaited_.reset();
  try {
    copy_->Save(**added, part.revision);
    Count("objects");
  } catch (const std::exception& error) {
    NoteError(params_.copy + ": " + error.what());
  }
  next_say_us_ = 0;  // What else is there?
}

}  // namespace vantage::link
