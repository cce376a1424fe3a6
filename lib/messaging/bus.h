// A thin wrapper around LCM: clear errors, message size limit, handlers that cannot throw through LCM's C frames, a clock.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

typedef struct _lcm_t lcm_t;

namespace vantage::messaging {

// LCM drops larger messages silently where the kernel's socket buffers are small.
inline constexpr int kMaxMessageBytes = 190000;
inline constexpr char kDefaultUrl[] = "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=2097152";

// What one subscription has seen.
struct SubscriptionCounts {
  std::int64_t received = 0;  // Decoded.
  std::int64_t bad = 0;       // Undecodable, or the handler threw.
  std::string last_error;     // "CHANNEL: why"; empty where there was none.
};

// Bytes of a raw message that cannot be right, whatever they claim: guards against sizes that make decoding allocate without bound.
// Specialised for the types that carry an int32_t array size.
template <typename Message>
bool PlausibleBytes(const void* /*data*/, std::uint32_t /*size*/) {
  return true;
}

// One LCM connection, used from one thread. Nodes of one program may share one (memq://).
class Bus {
 public:
  using Clock = std::function<std::int64_t()>;  // Microseconds since the epoch.

  // `url`: udpm://, memq:// or file://; empty = $LCM_DEFAULT_URL, else kDefaultUrl. `clock`: the system's by default.
  // Throws std::runtime_error that names the URL and says what is accepted.
  explicit Bus(const std::string& url = "", Clock clock = {});
  ~Bus();
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;

  const std::string& url() const { return url_; }
  std::int64_t now_us() const { return clock_(); }
  // Whether time is the system's; else somebody else's (a test's, a log's).
  bool real_time() const { return real_time_; }

  // Calls `handler` for every message of a channel, from within Handle. Exceptions it throws count as a bad message. The counts
  // live as long as the bus. `queue`: messages LCM keeps while we are busy; when full it drops the newest. Throws
  // std::runtime_error where LCM refuses (no multicast route).
  template <typename Message>
  const SubscriptionCounts& Subscribe(const std::string& channel, std::function<void(const Message&)> handler, int queue = 100) {
    return SubscribeRaw(
        channel,
        [handler = std::move(handler)](const void* data, std::uint32_t size) {
          Message message;
          const int bytes = static_cast<int>(size);
          if (!PlausibleBytes<Message>(data, size) || message.decode(data, 0, bytes) != bytes) return false;
          handler(message);
          return true;
        },
        queue);
  }

  // Sends. Throws std::length_error above kMaxMessageBytes: the sender has to split. false where LCM could not send (network down,
  // a log that is only read); counted.
  template <typename Message>
  bool Publish(const std::string& channel, const Message& message) {
    std::vector<unsigned char> bytes(CheckedSize(channel, message.getEncodedSize()));
    if (message.encode(bytes.data(), 0, static_cast<int>(bytes.size())) < 0) ThrowUnencodable(channel);
    return PublishRaw(channel, bytes.data(), bytes.size());
  }
  bool PublishRaw(const std::string& channel, const void* data, std::size_t size);
  // Hears everything that is published here, before it is sent, in order; empty: nobody does.
  using Tap = std::function<void(const std::string& channel, const void* data, std::size_t size)>;
  void SetTap(Tap tap) { tap_ = std::move(tap); }
  std::int64_t publish_failures() const { return publish_failures_; }

  enum class Handled { kMessage, kNothing, kEnd };  // kEnd: the log has ended or the connection is broken.
  // Waits up to `timeout_ms` for one message and runs its handlers. A signal is kNothing.
  Handled Handle(int timeout_ms);
  // Handles everything that is there now, at most `limit` messages.
  Handled Drain(int limit = 10000);
  // Becomes readable when there is something to handle; for poll().
  int file_descriptor() const;

 private:
  using RawHandler = std::function<bool(const void*, std::uint32_t)>;  // false: not a message of that type.
  struct Subscription;

  const SubscriptionCounts& SubscribeRaw(const std::string& channel, RawHandler handler, int queue);
  static std::size_t CheckedSize(const std::string& channel, int size);
  [[noreturn]] static void ThrowUnencodable(const std::string& channel);

  std::string url_;
  Clock clock_;
  bool real_time_ = true;
  Tap tap_;
  lcm_t* lcm_ = nullptr;
  std::vector<std::unique_ptr<Subscription>> subscriptions_;
  std::int64_t publish_failures_ = 0;
};

// Microseconds since the epoch, by the system's clock.
std::int64_t SystemTime_us();

// How long work takes: real time, or on a clock of somebody else the time that passes there, so that what is published is the same
// on every run of a replay.
class Stopwatch {
 public:
  explicit Stopwatch(const Bus& bus) : bus_(bus), begin_(std::chrono::steady_clock::now()), begin_us_(bus.now_us()) {}
  double ms() const {
    if (!bus_.real_time()) return 1e-3 * static_cast<double>(bus_.now_us() - begin_us_);
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin_).count();
  }

 private:
  const Bus& bus_;
  std::chrono::steady_clock::time_point begin_;
  std::int64_t begin_us_;
};

}  // namespace vantage::messaging
