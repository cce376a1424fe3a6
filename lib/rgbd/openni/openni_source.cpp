#include "rgbd/openni/openni_source.h"

#include <OpenNI.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <deque>
#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <thread>
#include <vector>

#include "rgbd/openni/openni_library.h"
#include "rgbd/openni/video_mode.h"

namespace vantage::rgbd {
namespace {

constexpr std::size_t kLongestQueue = 30;  // Frames of one stream that wait for the other: a second's worth.

constexpr std::chrono::milliseconds kSettle{30};

constexpr int kLookEvery_ms = 100;  // A device that is unplugged is noticed so soon.

struct TimedImage {
  std::int64_t time_us = 0;  // The stream's own clock, repeats laid end to end.
  cv::Mat image;
};

// A stream, the images read from it that still wait for their partner, and where it is in a recording.
struct Stream {
  openni::VideoStream video;
  std::deque<TimedImage> waiting;
  bool mirrored = false;
  int frames = 0;  // Of a recording; 0 where unknown.
  int last_index = 0;
  std::int64_t last_raw_us = -1;
  std::size_t loop = 0;  // How often the recording started again.
};

double Focal(int size_px, double field_of_view_rad) { return 0.5 * size_px / std::tan(0.5 * field_of_view_rad); }

}  // namespace

void OpenNiParams::Check() const {
  if (!(std::isfinite(speed) && speed >= 0.0))
    throw std::invalid_argument("openni: speed must be >= 0, is " + std::to_string(speed));
  if (timeout_ms <= 0) throw std::invalid_argument("openni: timeout_ms must be > 0, is " + std::to_string(timeout_ms));
  if (width < 0 || height < 0 || (width > 0) != (height > 0))
    throw std::invalid_argument("openni: width and height must be > 0, or both 0, are " + std::to_string(width) + " and " +
                                std::to_string(height));
  if (fps < 0) throw std::invalid_argument("openni: fps must be >= 0, is " + std::to_string(fps));
  if (calibration) calibration->Check();
}

class OpenNiSource::Implementation {
 public:
  explicit Implementation(const OpenNiParams& params) : params_(params), uri_(params.uri) {
    Open();
    OpenStream(color_, openni::SENSOR_COLOR, "colour");
    OpenStream(depth_, openni::SENSOR_DEPTH, "depth");
    ChooseModes();
    if (device_.isImageRegistrationModeSupported(openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR))
      device_.setImageRegistrationMode(openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR);
    registered_ = device_.getImageRegistrationMode() == openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR;
    // Where it cannot, pairing by time does.
    in_step_ =
        !device_.isFile() && device_.setDepthColorSyncEnabled(true) == openni::STATUS_OK && device_.getDepthColorSyncEnabled();
    FindCamera();
    interval_us_ = 1000000 / std::max(1, depth_.video.getVideoMode().getFps());
    if (!params_.record.empty()) PrepareRecording();
    for (Stream* stream : {&color_, &depth_})
      if (stream->video.start() != openni::STATUS_OK) Fail(uri_, "expected the streams to start, found: " + Complaint());
    if (recorder_.isValid() && !is_recording()) StartRecordingOrLeaveNone();
  }

  ~Implementation() {
    Stop();
    // Only now: a recorder that goes while its streams run locks them and itself in the other order than a frame that comes does.
    if (recorder_.isValid()) {
      recorder_.stop();
      recorder_.destroy();
    }
    // The file driver's thread walks its list of streams without a lock; with all of them stopped it only looks every 10 ms.
    // Streams that go while it spins at the end of a file crash it.
    if (device_.isFile()) std::this_thread::sleep_for(kSettle);
    color_.video.destroy();
    depth_.video.destroy();
    device_.close();
  }

  std::optional<Frame> Next() {
    while (!ended_ && !DropUnpaired()) {
      if (AtEnd() || !ReadOne()) Stop();
    }
    if (ended_) return std::nullopt;
    const std::int64_t time_us = color_.waiting.front().time_us;
    Frame frame;
    frame.id = next_id_++;
    frame.color = color_.waiting.front().image;
    frame.depth = depth_.waiting.front().image;
    frame.camera = camera_;
    color_.waiting.pop_front();
    depth_.waiting.pop_front();
    Fit(frame);
    if (undistorter_) undistorter_->Undistort(frame);
    frame.utime = Epoch(time_us) + time_us;
    Pace(time_us);
    return frame;
  }

  const std::string& uri() const { return uri_; }
  bool is_recording() const { return device_.isFile(); }
  int recorded_frames() const { return is_recording() ? std::min(color_.frames, depth_.frames) : 0; }
  bool registered() const { return registered_; }
  bool in_step() const { return in_step_; }
  std::string modes() const {
    return "colour " + Describe(color_.video.getVideoMode()) + ", depth " + Describe(depth_.video.getVideoMode()) +
           (registered_ ? ", registered" : "") + (in_step_ ? ", in step" : "");
  }
  const geometry::PinholeCamera& camera() const { return camera_; }

 private:
  void Open() {
    const bool is_file = uri_.size() > 4 && uri_.compare(uri_.size() - 4, 4, ".oni") == 0;
    if (is_file && !std::filesystem::is_regular_file(uri_))
      Fail(uri_, "expected an .oni recording, found no such file; check the path");
    std::string listed;
    if (!is_file) uri_ = FindDevice(params_.uri, params_.elsewhere, listed);
    gone_.emplace(uri_);
    if (device_.open(uri_.c_str()) == openni::STATUS_OK) return SetUpPlayback();
    if (is_file) Fail(uri_, "expected an .oni recording, found: " + Complaint() + "; is it whole, and made by OpenNI2?");
    if ((", " + listed + ", ").find(", " + uri_ + ", ") == std::string::npos) FailMissing(uri_, listed);
    Fail(uri_, "the device is there, but cannot be opened: " + Complaint() +
                   "; may this user open it (scripts/doctor says how), is another program using it?");
  }

  // A recording left running at its end would keep a core busy.
  void Stop() {
    ended_ = true;
    color_.video.stop();
    depth_.video.stop();
  }

  void SetUpPlayback() {
    openni::PlaybackControl* playback = device_.getPlaybackControl();
    if (!playback) return;
    // Frames come when they are asked for, so that none is lost; Pace() keeps the time.
    if (playback->setSpeed(-1.0F) != openni::STATUS_OK) Fail(uri_, "expected control of the playback, found: " + Complaint());
    playback->setRepeatEnabled(params_.repeat);
  }

  void OpenStream(Stream& stream, openni::SensorType type, const std::string& name) {
    if (!device_.hasSensor(type))
      Fail(uri_, "expected a " + name + " stream, found none; an RGB-D camera or recording of both streams is needed");
    if (stream.video.create(device_, type) != openni::STATUS_OK)
      Fail(uri_, "expected the " + name + " stream to open, found: " + Complaint());
    if (!device_.isFile()) stream.video.setMirroringEnabled(false);
    stream.mirrored = stream.video.getMirroringEnabled();
    if (openni::PlaybackControl* playback = device_.getPlaybackControl()) stream.frames = playback->getNumberOfFrames(stream.video);
  }

  // Sets the modes that are wanted; a recording's are as they are.
  void ChooseModes() {
    const openni::SensorInfo& color = color_.video.getSensorInfo();
    const auto mode = ChooseMode(color, color_.video.getVideoMode(), {params_.width, params_.height, params_.fps});
    if (!mode) FailMode("colour", params_.width, params_.height, color);
    SetMode(color_, *mode, "colour");
    const int width = mode->getResolutionX(), height = mode->getResolutionY();
    const openni::SensorInfo& depth = depth_.video.getSensorInfo();
    const auto depth_mode = ChooseDepthMode(depth, depth_.video.getVideoMode(), width, height, params_.fps);
    if (!depth_mode) FailMode("depth of the shape", width, height, depth);
    SetMode(depth_, *depth_mode, "depth");
  }

  [[noreturn]] void FailMode(const std::string& what, int width, int height, const openni::SensorInfo& sensor) const {
    Fail(uri_, "expected " + what + (width > 0 ? " " + std::to_string(width) + "x" + std::to_string(height) : "") +
                   (params_.fps > 0 ? " at " + std::to_string(params_.fps) + " Hz" : "") + ", found " + DescribeAll(sensor) +
                   "; choose one of these");
  }

  void SetMode(Stream& stream, const openni::VideoMode& mode, const std::string& name) {
    const openni::VideoMode now = stream.video.getVideoMode();
    if (device_.isFile() || (mode.getPixelFormat() == now.getPixelFormat() && mode.getResolutionX() == now.getResolutionX() &&
                             mode.getResolutionY() == now.getResolutionY() && mode.getFps() == now.getFps()))
      return;
    if (stream.video.setVideoMode(mode) != openni::STATUS_OK)
      Fail(uri_, "expected " + name + " in " + Describe(mode) + ", found: " + Complaint());
  }

  void PrepareRecording() {
    const std::string& file = params_.record;
    if (std::filesystem::exists(file)) Fail(file, "expected a new recording, found that file there; name another");
    if (recorder_.create(file.c_str()) != openni::STATUS_OK ||
        recorder_.attach(color_.video, !params_.record_lossless) != openni::STATUS_OK ||
        recorder_.attach(depth_.video, false) != openni::STATUS_OK || (is_recording() && recorder_.start() != openni::STATUS_OK))
      Fail(file, "expected to record there, found: " + Complaint() + "; does its folder exist, and may it be written?");
  }

  // A camera that is silent leaves no file behind that would be in the way when it is opened anew.
  void StartRecordingOrLeaveNone() {
    try {
      StartRecording();
    } catch (const std::runtime_error&) {
      recorder_.destroy();
      std::error_code ignored;
      std::filesystem::remove(params_.record, ignored);
      throw;
    }
  }

  // OpenNI's recorder calls the first frame of either stream time 0. So it starts just after a pair came, when the next is far.
  void StartRecording() {
    const auto least = std::chrono::microseconds(interval_us_ / 3);
    for (bool waited = false; !waited;) {
      color_.waiting.clear();
      depth_.waiting.clear();
      const auto begin = std::chrono::steady_clock::now();
      while (!DropUnpaired()) ReadOne();
      waited = std::chrono::steady_clock::now() - begin > least;
    }
    color_.waiting.clear();
    depth_.waiting.clear();
    if (recorder_.start() != openni::STATUS_OK) Fail(params_.record, "expected to record there, found: " + Complaint());
  }

  void FindCamera() {
    const openni::VideoMode mode = color_.video.getVideoMode();
    const int width = mode.getResolutionX(), height = mode.getResolutionY();
    if (params_.calibration) {
      camera_ = params_.calibration->camera;
      if (camera_.width != width || camera_.height != height)
        Fail(uri_, "expected colour of " + std::to_string(camera_.width) + "x" + std::to_string(camera_.height) +
                       " as calibrated, found " + std::to_string(width) + "x" + std::to_string(height) +
                       "; choose that mode, or calibrate in this one");
      undistorter_.emplace(*params_.calibration);
      return;
    }
    for (Stream* stream : {&color_, &depth_}) {
      const double across = stream->video.getHorizontalFieldOfView(), down = stream->video.getVerticalFieldOfView();
      if (!(across > 0.0 && across < 3.1 && down > 0.0 && down < 3.1)) continue;
      camera_ = {width, height, Focal(width, across), Focal(height, down), 0.5 * (width - 1), 0.5 * (height - 1)};
      return;
    }
    Fail(uri_, "expected a field of view, found 0 for both streams; calibrate the camera (vantage calibrate) and name the file");
  }

  // Waits for either stream and takes one image from it. False at the end of a recording.
  bool ReadOne() {
    std::array<openni::VideoStream*, 2> videos{&color_.video, &depth_.video};
    int ready = -1;
    openni::Status status = openni::STATUS_TIME_OUT;
    for (int waited_ms = 0; waited_ms < params_.timeout_ms && status == openni::STATUS_TIME_OUT; waited_ms += kLookEvery_ms) {
      CheckPlugged();
      const int wait_ms = std::min(kLookEvery_ms, params_.timeout_ms - waited_ms);
      status = openni::OpenNI::waitForAnyStream(videos.data(), 2, &ready, wait_ms);
    }
    CheckPlugged();
    if (status == openni::STATUS_TIME_OUT) {
      if (is_recording() && (color_.frames == 0 || depth_.frames == 0)) return false;  // Nobody knows its length.
      Fail(uri_, "expected a frame within " + std::to_string(params_.timeout_ms) + " ms, found none; " +
                     (is_recording() ? "is the recording cut off?" : "the device is plugged in, but silent"));
    }
    Stream& stream = ready == 0 ? color_ : depth_;
    openni::VideoFrameRef frame;
    if (status != openni::STATUS_OK || stream.video.readFrame(&frame) != openni::STATUS_OK || !frame.isValid())
      Fail(uri_, "expected a frame, found: " + Complaint());
    TimedImage timed;
    timed.time_us = Unroll(stream, static_cast<std::int64_t>(frame.getTimestamp()));
    stream.last_index = frame.getFrameIndex();
    timed.image = Convert(frame);
    if (timed.image.empty() || (timed.image.type() == CV_16UC1) != (&stream == &depth_))
      Fail(uri_, "expected RGB888, YUV422, YUYV or GRAY8 colour and depth in 1 mm or 0.1 mm, found pixel format " +
                     std::to_string(frame.getVideoMode().getPixelFormat()) + "; set another mode");
    if (stream.mirrored) {
      cv::Mat flipped;
      cv::flip(timed.image, flipped, 1);
      timed.image = flipped;
    }
    stream.waiting.push_back(std::move(timed));
    if (stream.waiting.size() > kLongestQueue) stream.waiting.pop_front();
    return true;
  }

  void CheckPlugged() const {
    if (gone_->gone()) throw DeviceGone(uri_ + ": the device was unplugged");
  }

  // The time with repeats of a recording laid end to end.
  std::int64_t Unroll(Stream& stream, std::int64_t raw_us) {
    if (is_recording() && raw_us < stream.last_raw_us) {
      ++stream.loop;
      if (loop_starts_us_.size() <= stream.loop)
        loop_starts_us_.push_back(loop_starts_us_.back() + std::max(color_.last_raw_us, depth_.last_raw_us) + interval_us_);
    }
    stream.last_raw_us = raw_us;
    return loop_starts_us_[stream.loop] + raw_us;
  }

  // Lets go of images that will find no partner; true where the two in front are a pair.
  bool DropUnpaired() {
    while (!color_.waiting.empty() && !depth_.waiting.empty()) {
      const std::int64_t ahead_us = color_.waiting.front().time_us - depth_.waiting.front().time_us;
      if (std::abs(ahead_us) <= interval_us_ / 2 + 1) return true;
      (ahead_us < 0 ? color_ : depth_).waiting.pop_front();
    }
    return false;
  }

  bool AtEnd() const {
    if (!is_recording() || params_.repeat) return false;
    const auto done = [](const Stream& stream) { return stream.frames > 0 && stream.last_index >= stream.frames; };
    return (done(color_) && color_.waiting.empty()) || (done(depth_) && depth_.waiting.empty()) || (done(color_) && done(depth_));
  }

  // Depth as large as colour: a smaller or larger image of the same shape is resized, to the nearest measured value.
  void Fit(Frame& frame) const {
    if (frame.color.cols != camera_.width || frame.color.rows != camera_.height)
      Fail(uri_, "expected colour of the size it started with, found another; start again");
    if (frame.depth.size() == frame.color.size()) return;
    if (frame.depth.cols * frame.color.rows != frame.depth.rows * frame.color.cols)
      Fail(uri_, "expected depth of colour's shape, found " + std::to_string(frame.depth.cols) + "x" +
                     std::to_string(frame.depth.rows) + "; set modes of the same shape");
    cv::Mat resized;
    cv::resize(frame.depth, resized, frame.color.size(), 0.0, 0.0, cv::INTER_NEAREST);
    frame.depth = resized;
  }

  // The utime of the stream's time 0: a device's clock starts anywhere, so its first frame is now.
  std::int64_t Epoch(std::int64_t time_us) {
    if (is_recording()) return params_.start_utime;
    if (!device_epoch_us_) {
      const auto now = std::chrono::system_clock::now().time_since_epoch();
      device_epoch_us_ = std::chrono::duration_cast<std::chrono::microseconds>(now).count() - time_us;
    }
    return *device_epoch_us_;
  }

  // Sleeps until a recording's frame is due.
  void Pace(std::int64_t time_us) {
    if (!is_recording() || params_.speed == 0.0) return;
    const auto now = std::chrono::steady_clock::now();
    if (!first_) first_ = {now, time_us};
    const auto due = std::chrono::duration<double, std::micro>(static_cast<double>(time_us - first_->time_us) / params_.speed);
    std::this_thread::sleep_until(first_->when + std::chrono::duration_cast<std::chrono::steady_clock::duration>(due));
  }

  struct Start {
    std::chrono::steady_clock::time_point when;
    std::int64_t time_us;
  };

  OpenNiParams params_;
  std::string uri_;  // What is open.
  Library library_;  // Before all that uses it, so that it goes last.
  std::optional<GoneListener> gone_;
  openni::Device device_;
  Stream color_, depth_;
  openni::Recorder recorder_;
  std::optional<Undistorter> undistorter_;
  geometry::PinholeCamera camera_;
  bool registered_ = false;
  bool in_step_ = false;
  bool ended_ = false;
  std::int64_t interval_us_ = 33333;
  std::int64_t next_id_ = 0;
  std::vector<std::int64_t> loop_starts_us_{0};
  std::optional<std::int64_t> device_epoch_us_;
  std::optional<Start> first_;
};

OpenNiSource::OpenNiSource(const OpenNiParams& params) {
  params.Check();
  implementation_ = std::make_unique<Implementation>(params);
}
OpenNiSource::~OpenNiSource() = default;
std::optional<Frame> OpenNiSource::Next() { return implementation_->Next(); }
const std::string& OpenNiSource::uri() const { return implementation_->uri(); }
bool OpenNiSource::is_recording() const { return implementation_->is_recording(); }
int OpenNiSource::recorded_frames() const { return implementation_->recorded_frames(); }
bool OpenNiSource::in_step() const { return implementation_->in_step(); }
std::string OpenNiSource::modes() const { return implementation_->modes(); }
bool OpenNiSource::registered() const { return implementation_->registered(); }
const geometry::PinholeCamera& OpenNiSource::camera() const { return implementation_->camera(); }

}  // namespace vantage::rgbd
