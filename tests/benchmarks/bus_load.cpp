// What of a camera's stream arrives: one sender of 640 x 480 colour and depth, several subscribers, each a process, over real
// multicast. Run it in a network of its own: tests/system/in_network build/bin/bus_load [--seconds 60] [--busy 2] ...
#include <sched.h>
#include <signal.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <thread>

#include "features/memory.h"
#include "messaging/frame_link.h"
#include "messaging/run_loop.h"
#include "simulation/simulated_world.h"

namespace {

using vantage::messaging::Bus;

struct Options {
  double seconds = 60.0;
  double rate_hz = 30.0;
  int subscribers = 4;
  int busy = 0;
  bool awake = false;
  int buffer_bytes = 212992;
  vantage::messaging::FrameSenderParams sender;
};

std::string Url(const Options& options) {
  return "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=" + std::to_string(options.buffer_bytes);
}

// What one subscriber reports through its pipe.
struct Report {
  std::int64_t frames = 0;
  std::int64_t gaps = 0;
  std::int64_t bad = 0;
  double median_ms = 0.0;
  double p99_ms = 0.0;
  double max_ms = 0.0;
};

// Notes the age of every frame when its last part has arrived.
Report Listen(const Options& options, int stop_fd) {
  Bus bus(Url(options));
  vantage::messaging::FrameReceiver receiver(bus);
  std::vector<double> ages_ms;
  std::int64_t seen = 0;
  while (true) {
    fd_set fds;
    FD_ZERO(&fds);
    FD_SET(bus.file_descriptor(), &fds);
    FD_SET(stop_fd, &fds);
    if (select(std::max(bus.file_descriptor(), stop_fd) + 1, &fds, nullptr, nullptr, nullptr) < 0) break;
    while (bus.Handle(0) == Bus::Handled::kMessage) {
      if (receiver.frames() == seen) continue;
      seen = receiver.frames();
      ages_ms.push_back(1e-3 * static_cast<double>(bus.now_us() - receiver.newest_utime()));
    }
    if (FD_ISSET(stop_fd, &fds)) break;
  }
  std::sort(ages_ms.begin(), ages_ms.end());
  Report report;
  report.frames = receiver.frames();
  report.gaps = receiver.gaps();
  report.bad = receiver.bad();
  if (ages_ms.empty()) return report;
  report.median_ms = ages_ms[ages_ms.size() / 2];
  report.p99_ms = ages_ms[ages_ms.size() * 99 / 100];
  report.max_ms = ages_ms.back();
  return report;
}

struct Subscriber {
  pid_t pid = 0;
  int stop = -1;
  int answer = -1;
};

Subscriber StartSubscriber(const Options& options) {
  int stop[2], answer[2];
  if (pipe(stop) != 0 || pipe(answer) != 0) throw std::runtime_error("cannot make a pipe");
  const pid_t pid = fork();
  if (pid == 0) {
    close(stop[1]);
    const Report report = Listen(options, stop[0]);
    const bool told = write(answer[1], &report, sizeof report) == sizeof report;
    _exit(told ? 0 : 1);
  }
  close(stop[0]);
  close(answer[1]);
  return {pid, stop[1], answer[0]};
}

pid_t StartBusy(bool only_when_idle) {
  const pid_t pid = fork();
  if (pid == 0) {
    const sched_param lowest{};
    if (only_when_idle && sched_setscheduler(0, SCHED_IDLE, &lowest) != 0) _exit(1);
    for (volatile std::uint64_t i = 0;; i = i + 1) {
    }
  }
  return pid;
}

// Processor time of the whole machine in clock ticks.
struct MachineTicks {
  double all = 0.0;
  double idle = 0.0;
  double stolen = 0.0;  // By a hypervisor, while something was to be done.
};

MachineTicks ReadMachineTicks() {
  std::ifstream file("/proc/stat");
  std::string word;
  file >> word;
  MachineTicks ticks;
  double value = 0.0;
  for (int i = 0; i < 8 && file >> value; ++i) {
    ticks.all += value;
    if (i == 3 || i == 4) ticks.idle += value;
    if (i == 7) ticks.stolen += value;
  }
  return ticks;
}

std::vector<vantage::rgbd::Frame> Frames() {
  const auto params = vantage::simulation::LoadWorldParams(std::string(VANTAGE_SOURCE_DIR) + "/config/worlds/table.yaml");
  const vantage::simulation::SimulatedWorld world(params);
  std::vector<vantage::rgbd::Frame> frames;
  for (int i = 0; i < 8; ++i) {
    const Eigen::AngleAxisd turn(0.7 * i, Eigen::Vector3d::UnitZ());
    frames.push_back(world.Look(vantage::geometry::Rigid(turn) * world.StartPose(), static_cast<std::uint32_t>(i)));
  }
  return frames;
}

void Run(const Options& options) {
  auto frames = Frames();
  std::vector<Subscriber> subscribers;
  for (int i = 0; i < options.subscribers; ++i) subscribers.push_back(StartSubscriber(options));
  std::vector<pid_t> busy;
  for (int i = 0; i < options.busy; ++i) busy.push_back(StartBusy(false));
  for (unsigned i = 0; options.awake && i < std::thread::hardware_concurrency(); ++i) busy.push_back(StartBusy(true));
  sleep(2);

  const MachineTicks ticks = ReadMachineTicks();
  std::int64_t sent = 0, bytes = 0;
  std::vector<double> send_ms;
  {
    Bus bus(Url(options));
    bus.SetTap([&](const std::string&, const void*, std::size_t size) { bytes += static_cast<std::int64_t>(size); });
    vantage::messaging::FrameSender sender(bus, options.sender);
    const auto begin = std::chrono::steady_clock::now();
    const auto count = static_cast<std::int64_t>(options.seconds * options.rate_hz);
    for (; sent < count; ++sent) {
      std::this_thread::sleep_until(begin + std::chrono::duration<double>(static_cast<double>(sent) / options.rate_hz));
      auto& frame = frames[static_cast<std::size_t>(sent) % frames.size()];
      frame.utime = bus.now_us();
      sender.Send(frame);
      send_ms.push_back(1e-3 * static_cast<double>(bus.now_us() - frame.utime));
    }
  }
  const MachineTicks after = ReadMachineTicks();
  sleep(1);

  std::sort(send_ms.begin(), send_ms.end());
  std::printf(
      "%lld frames sent at %.0f Hz, %.0f KB each, encoding and sending %.1f ms (median); machine %.0f %% idle, %.1f %% stolen\n",
      static_cast<long long>(sent), options.rate_hz, 1e-3 * static_cast<double>(bytes) / static_cast<double>(sent),
      send_ms[send_ms.size() / 2], 100.0 * (after.idle - ticks.idle) / (after.all - ticks.all),
      100.0 * (after.stolen - ticks.stolen) / (after.all - ticks.all));
  for (std::size_t i = 0; i < subscribers.size(); ++i) {
    const char word = 1;
    [[maybe_unused]] const auto told = write(subscribers[i].stop, &word, 1);
    Report report;
    if (read(subscribers[i].answer, &report, sizeof report) != sizeof report) throw std::runtime_error("a subscriber died");
    waitpid(subscribers[i].pid, nullptr, 0);
    std::printf("subscriber %zu: %lld lost (counted: %lld gaps, %lld bad); capture to whole %.1f ms median, %.1f 99 %%, %.1f max\n",
                i, static_cast<long long>(sent - report.frames), static_cast<long long>(report.gaps),
                static_cast<long long>(report.bad), report.median_ms, report.p99_ms, report.max_ms);
  }
  for (const pid_t pid : busy) {
    kill(pid, SIGKILL);
    waitpid(pid, nullptr, 0);
  }
}

}  // namespace

int main(int argc, char** argv) {
  vantage::features::KeepFreedMemory();
  Options options;
  CLI::App app("What of a camera's stream arrives at several subscribers", "bus_load");
  app.add_option("--seconds", options.seconds)->capture_default_str();
  app.add_option("--rate", options.rate_hz)->capture_default_str();
  app.add_option("--subscribers", options.subscribers)->capture_default_str();
  app.add_option("--busy", options.busy, "Processes that do nothing but burn a core")->capture_default_str();
  app.add_flag("--awake", options.awake,
               "Keep every core from sleeping, by work that yields to any other: a hypervisor may be slow to wake a virtual core");
  app.add_option("--buffer", options.buffer_bytes, "Socket buffer asked for; 212992: what a stock kernel grants")
      ->capture_default_str();
  app.add_option("--part-bytes", options.sender.max_part_bytes)->capture_default_str();
  app.add_option("--pace-us", options.sender.pace_us)->capture_default_str();
  app.add_option("--quality", options.sender.jpeg_quality)->capture_default_str();
  app.add_flag("--raw", options.sender.raw);
  CLI11_PARSE(app, argc, argv);
  try {
    Run(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bus_load: %s\n", error.what());
    return 1;
  }
  return 0;
}
