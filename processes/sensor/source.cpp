#include "sensor/source.h"

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

class OpenNiFrames : public FrameSource {
 public:
  OpenNiFrames(const std::string& uri, bool loop) : source_(Params(uri, loop)) {}

  std::optional<rgbd::Frame> Next(const std::optional<geometry::Rigid>& T_world_camera) override {
    auto frame = source_.Next();
    ended_ = !frame;
    if (!frame) return frame;
    frame->T_world_camera = T_world_camera;
    if (source_.is_recording()) frame->utime = 0;
    return frame;
  }
  bool Ended() const override { return ended_; }
  std::string Name() const override { return source_.uri(); }

 private:
  static rgbd::OpenNiParams Params(const std::string& uri, bool loop) {
    rgbd::OpenNiParams params;
    params.uri = uri;
    params.repeat = loop;
    params.timeout_ms = 500;  // The process stays responsive where a device is silent.
    return params;
  }

  rgbd::OpenNiSource source_;
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

std::unique_ptr<FrameSource> MakeOpenNiSource(const std::string& uri, bool loop) {
  return std::make_unique<OpenNiFrames>(uri, loop);
}

std::unique_ptr<FrameSource> MakeWorldSource(std::shared_ptr<const simulation::World> world, std::uint32_t seed) {
  return std::make_unique<WorldSource>(std::move(world), seed);
}

}  // namespace vantage::sensor
