#include "messaging/host_clocks.h"

#include <algorithm>
#include <stdexcept>

namespace vantage::messaging {
namespace {

constexpr std::size_t kExchanges = 8;
constexpr std::int64_t kForget_us = 10000000;
constexpr std::size_t kMaxHosts = 100;  // Names come from outside.

}  // namespace

HostClocks::HostClocks(std::string host) : host_(std::move(host)) {
  if (host_.empty()) throw std::invalid_argument("the name of this host must not be empty");
}

host_clock_t HostClocks::Say(std::int64_t now_us) {
  host_clock_t message;
  message.utime = now_us;
  message.host = host_;
  for (auto other = others_.begin(); other != others_.end();) {
    if (now_us - other->second.received_us > kForget_us) {
      other = others_.erase(other);
      continue;
    }
    clock_echo_t echo;
    echo.host = other->first;
    echo.sent_us = other->second.sent_us;
    echo.received_us = other->second.received_us;
    message.echoes.push_back(echo);
    ++other;
  }
  message.count = static_cast<std::int16_t>(message.echoes.size());
  return message;
}

void HostClocks::Hear(const host_clock_t& message, std::int64_t received_us) {
  if (message.host == host_ || message.host.empty()) return;
  if (!others_.count(message.host) && others_.size() >= kMaxHosts) return;
  Other& other = others_[message.host];
  other.sent_us = message.utime;
  other.received_us = received_us;
  for (const clock_echo_t& echo : message.echoes) {
    if (echo.host != host_) continue;
    // t1: ours left, t2: it was heard there, t3: theirs left, t4: it was heard here.
    const auto there_us = static_cast<double>(echo.received_us - echo.sent_us);
    const auto back_us = static_cast<double>(message.utime - received_us);
    const Exchange exchange{0.5 * (there_us + back_us), there_us - back_us};
    // Between our sending and its answer its clock or ours may have been set: such an exchange says nothing.
    if (exchange.delay_us < 0.0 || exchange.delay_us > static_cast<double>(kForget_us)) continue;
    other.exchanges.push_back(exchange);
    if (other.exchanges.size() > kExchanges) other.exchanges.pop_front();
  }
}

std::vector<ClockOffset> HostClocks::Offsets(std::int64_t now_us) const {
  std::vector<ClockOffset> offsets;
  for (const auto& [host, other] : others_) {
    if (other.exchanges.empty() || now_us - other.received_us > kForget_us) continue;
    const auto best = std::min_element(other.exchanges.begin(), other.exchanges.end(),
                                       [](const Exchange& a, const Exchange& b) { return a.delay_us < b.delay_us; });
    offsets.push_back({host, 1e-3 * best->offset_us, 1e-3 * best->delay_us, other.received_us});
  }
  return offsets;
}

}  // namespace vantage::messaging
