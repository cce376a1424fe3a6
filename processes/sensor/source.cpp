#include "sensor/source.h"

#include <algorithm>
#include <chrono>
#include <stdexcept>

#include "rgbd/openni/openni_source.h"

namespace vantage::sensor {
namespace {

class RecordingSource : public FrameSource {
 public:
  RecordingSource(const std::filesystem::path& folder, const std::string& frames, bool loop)
      : scene_(folder), ids_(rgbd::SelectFrames(scene_.ids(), frames)), loop_(loop) {
    if (ids_.empty()) throw std::runtime_error(folder.string() + ": no frames in '" + frames + "'");
  }

  std::optional<rgbd::Frame> Next(const std::optional<geometry::Rigid>&) override {
    if (next_ == ids_.size() && loop_) next_ = 0;
    if (next_ == ids_.size()) return std::nullopt;
    rgbd::Frame frame = scene_.Load(ids_[next_++]);
    frame.utime = 0;  // Played as if it happened now.
    return frame;
  }
  bool Ended() const override { return next_ == ids_.size() && !loop_; }
  std::string Name() const override { return scene_.folder().string(); }

 private:
  rgbd::BopScene scene_;
  std::vector<int> ids_;
  bool loop_;
  std::size_t next_ = 0;
};

constexpr int kTimeout_ms = 500;  // The process stays responsive where a device is silent.
constexpr std::chrono::seconds kLookEvery{1};

class OpenNiFrames : public FrameSource {
 public:
  explicit OpenNiFrames(const OpenNiOptions& options) : record_(options.record), max_silence_s_(options.max_silence_s) {
    if (!(max_silence_s_ >= 0.1)) throw std::invalid_argument("max_silence_s must be >= 0.1");
    params_.uri = options.uri;
    params_.repeat = options.loop;
    params_.width = options.width;
    params_.height = options.height;
    params_.fps = options.fps;
    params_.calibration = options.calibration;
    params_.record = options.record;
    params_.record_lossless = options.record_lossless;
    params_.timeout_ms = static_cast<int>(std::min<double>(kTimeout_ms, 1e3 * max_silence_s_));
    Open();
  }

  std::optional<rgbd::Frame> Next(const std::optional<geometry::Rigid>& T_world_camera) override {
    if (!source_ && !Reopen()) return std::nullopt;
    auto frame = Read();
    ended_ = !frame;
    if (!frame) return frame;
    frame->id = next_id_++;
    frame->T_world_camera = T_world_camera;
    if (source_->is_recording()) frame->utime = 0;
    return frame;
  }
  bool Ended() const override { return ended_; }
  bool Waiting() const override { return !source_; }
  std::string Name() const override { return name_; }

 private:
  void Open() {
    source_ = std::make_unique<rgbd::OpenNiSource>(params_);
    name_ = source_->uri() + ": " + source_->modes();
    heard_ = std::chrono::steady_clock::now();
    if (source_->is_recording()) return;
    params_.uri = source_->uri();  // The same device again, wherever it is plugged in.
    params_.elsewhere = true;
  }

  // Throws what keeps it from being opened.
  bool Reopen() {
    const auto now = std::chrono::steady_clock::now();
    if (now < next_look_) return false;
    next_look_ = now + kLookEvery;
    if (!record_.empty()) {
      const std::filesystem::path file(record_);
      params_.record =
          (file.parent_path() / (file.stem().string() + "-" + std::to_string(opened_ + 1) + file.extension().string())).string();
    }
    Open();
    ++opened_;
    return true;
  }

  std::optional<rgbd::Frame> Read() {
    try {
      auto frame = source_->Next();
      heard_ = std::chrono::steady_clock::now();
      return frame;
    } catch (const rgbd::DeviceGone&) {
      Close();
      throw;
    } catch (const std::runtime_error&) {
      const std::chrono::duration<double> silence = std::chrono::steady_clock::now() - heard_;
      if (!source_->is_recording() && silence.count() >= max_silence_s_) Close();
      throw;
    }
  }

  void Close() {
    source_.reset();
    next_look_ = std::chrono::steady_clock::now() + kLookEvery;
  }

  rgbd::OpenNiParams params_;
  std::string record_;
  double max_silence_s_;
  std::unique_ptr<rgbd::OpenNiSource> source_;  // None while the device is not there.
  std::string name_;
  std::chrono::steady_clock::time_point next_look_, heard_;
  int opened_ = 1;
  std::int64_t next_id_ = 0;
  bool ended_ = false;
};

class WorldSource : public FrameSource {
 public:
  WorldSource(std::shared_ptr<const simulation::World> world, std::uint32_t seed) : world_(std::move(world)), seed_(seed) {}

  std::optional<rgbd::Frame> Next(const std::optional<geometry::Rigid>& T_world_camera) override {
    rgbd::Frame frame = world_->Look(T_world_camera.value_or(world_->StartPose()), seed_ + static_cast<std::uint32_t>(count_));
    frame.id = count_++;
    frame.utime = 0;
    return frame;
  }
  std::string Name() const override { return "simulated world"; }

 private:
  std::shared_ptr<const simulation::World> world_;
  std::uint32_t seed_;
  std::int64_t count_ = 0;
};

}  // namespace

std::unique_ptr<FrameSource> MakeRecordingSource(const std::filesystem::path& folder, const std::string& frames, bool loop) {
  return std::make_unique<RecordingSource>(folder, frames, loop);
}

std::unique_ptr<FrameSource> MakeOpenNiSource(const OpenNiOptions& options) { return std::make_unique<OpenNiFrames>(options); }

std::unique_ptr<FrameSource> MakeWorldSource(std::shared_ptr<const simulation::World> world, std::uint32_t seed) {
  return std::make_unique<WorldSource>(std::move(world), seed);
}

}  // namespace vantage::sensor
