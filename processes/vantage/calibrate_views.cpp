#include "vantage/calibrate_views.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "messaging/channels.h"
#include "messaging/frame_link.h"
#include "messaging/mount_messages.h"

namespace vantage::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kMaxMountAge_us = 200000;

// Mean distance of the points that both views hold, pixels; infinite where there are none.
double MeanMove(const calibration::BoardView& a, const calibration::BoardView& b) {
  double sum = 0.0;
  int count = 0;
  for (std::size_t i = 0; i < a.points_m.size(); ++i) {
    for (std::size_t j = 0; j < b.points_m.size(); ++j) {
      if (a.points_m[i] != b.points_m[j]) continue;
      sum += (a.pixels[i] - b.pixels[j]).norm();
      ++count;
      break;
    }
  }
  return count > 0 ? sum / count : std::numeric_limits<double>::infinity();
}

// Takes views from frames and mount states as they come.
class Collector {
 public:
  Collector(messaging::Bus& bus, const calibration::Board& board, const StreamParams& params, Tell tell)
      : board_(board), params_(params), tell_(std::move(tell)), receiver_(bus) {
    bus.Subscribe<mount_state_t>(messaging::kMountState, [this](const mount_state_t& message) {
      if (const auto state = messaging::FromMessage(message)) mount_[message.utime] = state->T_world_mount;
      while (mount_.size() > 300) mount_.erase(mount_.begin());
    });
  }

  // Looks at the newest frame, if there is one.
  void Look() {
    const auto received = receiver_.Take();
    if (!received) return;
    const rgbd::Frame& frame = received->frame;
    if (first_us_ == 0) first_us_ = frame.utime;
    last_us_ = frame.utime;
    seen_.camera = frame.camera;
    ++seen_.images;
    SeenBoard view;
    view.name = std::to_string(frame.utime);
    view.board = calibration::FindBoard(rgbd::Gray(frame), board_);
    view.T_world_mount = MountAt(frame.utime);
    const bool still = MeanMove(view.board, before_) < params_.max_shake_px;
    before_ = view.board;
    if (view.board.empty() || !still || !IsNew(view.board) || (params_.with_mount && !view.T_world_mount)) return;
    seen_.views.push_back(view);
    if (tell_) tell_(static_cast<int>(seen_.views.size()), std::to_string(view.board.points_m.size()) + " points");
  }
  bool Done() const {
    return static_cast<int>(seen_.views.size()) >= params_.views ||
           1e-6 * static_cast<double>(last_us_ - first_us_) > params_.seconds;
  }
  SeenBoards seen() const { return seen_; }

 private:
  bool IsNew(const calibration::BoardView& view) const {
    return std::all_of(seen_.views.begin(), seen_.views.end(),
                       [&](const SeenBoard& taken) { return MeanMove(view, taken.board) > params_.min_move * seen_.camera.width; });
  }

  std::optional<geometry::Rigid> MountAt(std::int64_t utime) const {
    const auto after = mount_.lower_bound(utime);
    if (after == mount_.end() || after->first - utime > kMaxMountAge_us) {
      const bool near = after == mount_.end() && !mount_.empty() && utime - mount_.rbegin()->first < kMaxMountAge_us / 4;
      return near ? std::optional(mount_.rbegin()->second) : std::nullopt;
    }
    if (after->first == utime || after == mount_.begin()) return after->second;
    const auto before = std::prev(after);
    const double share = static_cast<double>(utime - before->first) / static_cast<double>(after->first - before->first);
    return geometry::Interpolate(before->second, after->second, share);
  }

  calibration::Board board_;
  StreamParams params_;
  Tell tell_;
  messaging::FrameReceiver receiver_;
  std::map<std::int64_t, geometry::Rigid> mount_;  // By utime.
  calibration::BoardView before_;
  SeenBoards seen_;
  std::int64_t first_us_ = 0;
  std::int64_t last_us_ = 0;
};

}  // namespace

SeenBoards ViewsOfFolder(const std::string& folder, const calibration::Board& board) {
  const fs::path images = fs::is_directory(fs::path(folder) / "rgb") ? fs::path(folder) / "rgb" : fs::path(folder);
  if (!fs::is_directory(images)) throw std::runtime_error(folder + ": no such folder; it is to hold images of the board");
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(images)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  SeenBoards seen;
  for (const auto& file : files) {
    const cv::Mat gray = cv::imread(file.string(), cv::IMREAD_GRAYSCALE);
    if (gray.empty()) continue;  // No image.
    if (seen.images++ > 0 && gray.size() != cv::Size(seen.camera.width, seen.camera.height)) {
      throw std::runtime_error(file.string() + ": " + std::to_string(gray.cols) + "x" + std::to_string(gray.rows) +
                               ", others are of another size; calibrate each mode by itself");
    }
    seen.camera.width = gray.cols;
    seen.camera.height = gray.rows;
    SeenBoard view;
    view.name = file.filename().string();
    view.board = calibration::FindBoard(gray, board);
    if (!view.board.empty()) seen.views.push_back(view);
  }
  if (seen.images == 0) throw std::runtime_error(images.string() + ": no images");
  return seen;
}

SeenBoards ViewsOfLog(const std::string& file, const calibration::Board& board, const StreamParams& params) {
  messaging::LogReader log(file);
  messaging::Bus bus("memq://");
  Collector collector(bus, board, params, {});
  while (const auto event = log.Next()) {
    const bool ours = event->channel == messaging::kSensorColor || event->channel == messaging::kSensorDepth ||
                      event->channel == messaging::kMountState;
    if (!ours) continue;
    bus.PublishRaw(event->channel, event->data.data(), event->data.size());
    bus.Drain();
    collector.Look();
    if (collector.Done()) break;
  }
  return collector.seen();
}

SeenBoards ViewsOfBus(const std::string& url, const calibration::Board& board, const StreamParams& params, const Tell& tell) {
  messaging::Bus bus(url);
  Collector collector(bus, board, params, tell);
  const std::int64_t end_us = bus.now_us() + static_cast<std::int64_t>(params.seconds * 1e6);
  while (!collector.Done() && bus.now_us() < end_us) {
    bus.Handle(100);
    bus.Drain();
    collector.Look();
  }
  return collector.seen();
}

}  // namespace vantage::cli
