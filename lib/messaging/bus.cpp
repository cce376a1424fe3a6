#include "messaging/bus.h"

#include <lcm/lcm.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <stdexcept>

#include "messaging/channels.h"

namespace vantage::messaging {

namespace {

// LCM writes lines of its own about a URL of an unknown kind; we say it in one.
bool KnownScheme(const std::string& url) {
  for (const char* scheme : {"udpm://", "memq://", "file://", "tcpq://"}) {
    if (url.rfind(scheme, 0) == 0) return true;
  }
  return false;
}

}  // namespace

struct Bus::Subscription {
  std::string channel;
  RawHandler handler;
  SubscriptionCounts counts;

  void Run(const void* data, std::uint32_t size) {
    try {
      if (handler(data, size)) {
        ++counts.received;
        return;
      }
      counts.last_error = channel + ": not a message of the type expected there, or damaged";
    } catch (const std::exception& error) {
      counts.last_error = channel + ": " + error.what();
    } catch (...) {
      counts.last_error = channel + ": unknown error in the handler";
    }
    ++counts.bad;
  }
};

std::string StatusChannel(const std::string& process) {
  std::string channel = process;
  std::transform(channel.begin(), channel.end(), channel.begin(), [](unsigned char c) { return std::toupper(c); });
  return channel + "_STATUS";
}

std::int64_t SystemTime_us() {
  return std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::system_clock::now().time_since_epoch()).count();
}

Bus::Bus(const std::string& url, Clock clock) : url_(url), real_time_(!clock) {
  clock_ = clock ? std::move(clock) : Clock(SystemTime_us);
  if (url_.empty()) {
    const char* environment = std::getenv("LCM_DEFAULT_URL");
    url_ = environment && *environment ? environment : kDefaultUrl;
  }
  if (KnownScheme(url_)) lcm_ = lcm_create(url_.c_str());
  if (!lcm_) {
    throw std::runtime_error("LCM URL '" + url_ + "' is unusable: expected udpm://ADDRESS:PORT?ttl=N, memq:// or file://LOG; try " +
                             kDefaultUrl);
  }
}

Bus::~Bus() {
  if (lcm_) lcm_destroy(lcm_);
}

const SubscriptionCounts& Bus::SubscribeRaw(const std::string& channel, RawHandler handler, int queue) {
  auto subscription = std::make_unique<Subscription>();
  subscription->channel = channel;
  subscription->handler = std::move(handler);
  const auto run = [](const lcm_recv_buf_t* buffer, const char*, void* user) {
    static_cast<Subscription*>(user)->Run(buffer->data, buffer->data_size);
  };
  lcm_subscription_t* handle = lcm_subscribe(lcm_, channel.c_str(), run, subscription.get());
  if (!handle) {
    throw std::runtime_error("LCM URL '" + url_ + "': cannot subscribe to " + channel +
                             ": is there a network with a multicast route (ip route add 224.0.0.0/4 dev lo)?");
  }
  lcm_subscription_set_queue_capacity(handle, queue);
  subscriptions_.push_back(std::move(subscription));
  return subscriptions_.back()->counts;
}

std::size_t Bus::CheckedSize(const std::string& channel, int size) {
  if (size > kMaxMessageBytes) {
    throw std::length_error(channel + ": a message of " + std::to_string(size) + " bytes; at most " +
                            std::to_string(kMaxMessageBytes) + " arrive for certain: split it");
  }
  return static_cast<std::size_t>(size);
}

void Bus::ThrowUnencodable(const std::string& channel) {
  throw std::logic_error(channel + ": message cannot be encoded: its counts do not match its arrays");
}

bool Bus::PublishRaw(const std::string& channel, const void* data, std::size_t size) {
  if (tap_) tap_(channel, data, size);
  if (lcm_publish(lcm_, channel.c_str(), data, static_cast<unsigned int>(size)) == 0) return true;
  ++publish_failures_;
  return false;
}

Bus::Handled Bus::Handle(int timeout_ms) {
  errno = 0;
  const int status = lcm_handle_timeout(lcm_, timeout_ms);
  if (status > 0) return Handled::kMessage;
  if (status == 0 || errno == EINTR) return Handled::kNothing;
  return Handled::kEnd;
}

Bus::Handled Bus::Drain(int limit) {
  Handled first = Handle(0);
  for (int i = 1; i < limit; ++i) {
    const Handled more = Handle(0);
    if (more == Handled::kEnd) return more;
    if (more == Handled::kNothing) break;
  }
  return first;
}

int Bus::file_descriptor() const { return lcm_get_fileno(lcm_); }

}  // namespace vantage::messaging
