#include "rgbd/openni/openni_source.h"

#include <OpenNI.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <deque>
#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <thread>
#include <vector>

namespace vantage::rgbd {
namespace {

constexpr std::size_t kLongestQueue = 30;  // Frames of one stream that wait for the other: a second's worth.

constexpr std::chrono::milliseconds kSettle{30};

// OpenNI's last complaint on one line.
std::string Complaint() {
  std::string text = openni::OpenNI::getExtendedError();
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c == '\n' || c == '\t' || c == '\r'; }, ' ');
  const std::size_t first = text.find_first_not_of(' '), last = text.find_last_not_of(' ');
  return first == std::string::npos ? "no reason given" : text.substr(first, last - first + 1);
}

[[noreturn]] void Fail(const std::string& uri, const std::string& what) {
  throw std::runtime_error((uri.empty() ? std::string("OpenNI2 device") : uri) + ": " + what);
}

// OpenNI counts its initialisations; one per source keeps the pairs in step.
class Library {
 public:
  Library() {
    if (openni::OpenNI::initialize() != openni::STATUS_OK)
      throw std::runtime_error("OpenNI2: expected to start, found: " + Complaint() + "; is libopenni2-0 installed whole?");
  }
  ~Library() { openni::OpenNI::shutdown(); }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;
};

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

cv::Mat Wrap(const openni::VideoFrameRef& frame, int type) {
  return {frame.getHeight(), frame.getWidth(), type, const_cast<void*>(frame.getData()),
          static_cast<std::size_t>(frame.getStrideInBytes())};
}

// A copy in our format: BGR or millimetres. Empty for a format that is not supported.
cv::Mat Convert(const openni::VideoFrameRef& frame) {
  cv::Mat image;
  switch (frame.getVideoMode().getPixelFormat()) {
    case openni::PIXEL_FORMAT_RGB888:
      cv::cvtColor(Wrap(frame, CV_8UC3), image, cv::COLOR_RGB2BGR);
      break;
    case openni::PIXEL_FORMAT_YUV422:
      cv::cvtColor(Wrap(frame, CV_8UC2), image, cv::COLOR_YUV2BGR_UYVY);
      break;
    case openni::PIXEL_FORMAT_YUYV:
      cv::cvtColor(Wrap(frame, CV_8UC2), image, cv::COLOR_YUV2BGR_YUYV);
      break;
    case openni::PIXEL_FORMAT_GRAY8:
      cv::cvtColor(Wrap(frame, CV_8UC1), image, cv::COLOR_GRAY2BGR);
      break;
    case openni::PIXEL_FORMAT_DEPTH_1_MM:
      image = Wrap(frame, CV_16UC1).clone();
      break;
    case openni::PIXEL_FORMAT_DEPTH_100_UM:
      Wrap(frame, CV_16UC1).convertTo(image, CV_16UC1, 0.1);
      break;
    default:
      break;
  }
  return image;
}

double Focal(int size_px, double field_of_view_rad) { return 0.5 * size_px / std::tan(0.5 * field_of_view_rad); }

}  // namespace

void OpenNiParams::Check() const {
  if (!(std::isfinite(speed) && speed >= 0.0))
    throw std::invalid_argument("openni: speed must be >= 0, is " + std::to_string(speed));
  if (timeout_ms <= 0) throw std::invalid_argument("openni: timeout_ms must be > 0, is " + std::to_string(timeout_ms));
  if (camera) camera->Check();
}

class OpenNiSource::Implementation {
 public:
  explicit Implementation(const OpenNiParams& params) : params_(params) {
    Open();
    OpenStream(color_, openni::SENSOR_COLOR, "colour");
    OpenStream(depth_, openni::SENSOR_DEPTH, "depth");
    if (device_.isImageRegistrationModeSupported(openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR))
      device_.setImageRegistrationMode(openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR);
    registered_ = device_.getImageRegistrationMode() == openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR;
    if (!device_.isFile()) device_.setDepthColorSyncEnabled(true);  // Where it cannot, pairing by time does.
    FindCamera();
    const int fps = std::max(1, depth_.video.getVideoMode().getFps());
    interval_us_ = 1000000 / fps;
    for (Stream* stream : {&color_, &depth_})
      if (stream->video.start() != openni::STATUS_OK) Fail(params_.uri, "expected the streams to start, found: " + Complaint());
  }

  ~Implementation() {
    Stop();
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
    frame.utime = Epoch(time_us) + time_us;
    Pace(time_us);
    return frame;
  }

  const OpenNiParams& params() const { return params_; }
  bool is_recording() const { return device_.isFile(); }
  int recorded_frames() const { return is_recording() ? std::min(color_.frames, depth_.frames) : 0; }
  bool registered() const { return registered_; }
  const geometry::PinholeCamera& camera() const { return camera_; }

 private:
  void Open() {
    const std::string& uri = params_.uri;
    const bool is_file = uri.size() > 4 && uri.compare(uri.size() - 4, 4, ".oni") == 0;
    if (is_file && !std::filesystem::is_regular_file(uri))
      Fail(uri, "expected an .oni recording, found no such file; check the path");
    if (device_.open(uri.empty() ? openni::ANY_DEVICE : uri.c_str()) == openni::STATUS_OK) {
      SetUpPlayback();
      return;
    }
    if (is_file) Fail(uri, "expected an .oni recording, found: " + Complaint() + "; is it whole, and made by OpenNI2?");
    Fail(uri, "expected a device, found: " + Complaint() + "; is it plugged in, and may this user open it? Or name an .oni file");
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
    if (playback->setSpeed(-1.0F) != openni::STATUS_OK)
      Fail(params_.uri, "expected control of the playback, found: " + Complaint());
    playback->setRepeatEnabled(params_.repeat);
  }

  void OpenStream(Stream& stream, openni::SensorType type, const std::string& name) {
    if (!device_.hasSensor(type))
      Fail(params_.uri, "expected a " + name + " stream, found none; an RGB-D camera or recording of both streams is needed");
    if (stream.video.create(device_, type) != openni::STATUS_OK)
      Fail(params_.uri, "expected the " + name + " stream to open, found: " + Complaint());
    if (!device_.isFile()) stream.video.setMirroringEnabled(false);
    stream.mirrored = stream.video.getMirroringEnabled();
    if (openni::PlaybackControl* playback = device_.getPlaybackControl()) stream.frames = playback->getNumberOfFrames(stream.video);
  }

  void FindCamera() {
    const openni::VideoMode mode = color_.video.getVideoMode();
    const int width = mode.getResolutionX(), height = mode.getResolutionY();
    if (params_.camera) {
      camera_ = *params_.camera;
      if (camera_.width != width || camera_.height != height)
        Fail(params_.uri, "expected a camera of " + std::to_string(camera_.width) + "x" + std::to_string(camera_.height) +
                              " as configured, found " + std::to_string(width) + "x" + std::to_string(height) +
                              "; set the intrinsics of this device");
      return;
    }
    for (Stream* stream : {&color_, &depth_}) {
      const double across = stream->video.getHorizontalFieldOfView(), down = stream->video.getVerticalFieldOfView();
      if (!(across > 0.0 && across < 3.1 && down > 0.0 && down < 3.1)) continue;
      camera_ = {width, height, Focal(width, across), Focal(height, down), 0.5 * (width - 1), 0.5 * (height - 1)};
      return;
    }
    Fail(params_.uri, "expected a field of view, found 0 for both streams; set the camera's intrinsics");
  }

  // Waits for either stream and takes one image from it. False at the end of a recording.
  bool ReadOne() {
    std::array<openni::VideoStream*, 2> videos{&color_.video, &depth_.video};
    int ready = -1;
    const openni::Status status = openni::OpenNI::waitForAnyStream(videos.data(), 2, &ready, params_.timeout_ms);
    if (status == openni::STATUS_TIME_OUT) {
      if (is_recording() && (color_.frames == 0 || depth_.frames == 0)) return false;  // Nobody knows its length.
      Fail(params_.uri, "expected a frame within " + std::to_string(params_.timeout_ms) + " ms, found none; " +
                            (is_recording() ? "is the recording cut off?" : "is the device still plugged in?"));
    }
    Stream& stream = ready == 0 ? color_ : depth_;
    openni::VideoFrameRef frame;
    if (status != openni::STATUS_OK || stream.video.readFrame(&frame) != openni::STATUS_OK || !frame.isValid())
      Fail(params_.uri, "expected a frame, found: " + Complaint());
    TimedImage timed;
    timed.time_us = Unroll(stream, static_cast<std::int64_t>(frame.getTimestamp()));
    stream.last_index = frame.getFrameIndex();
    timed.image = Convert(frame);
    if (timed.image.empty() || (timed.image.type() == CV_16UC1) != (&stream == &depth_))
      Fail(params_.uri, "expected RGB888, YUV422, YUYV or GRAY8 colour and depth in 1 mm or 0.1 mm, found pixel format " +
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
      Fail(params_.uri, "expected colour of the size it started with, found another; start again");
    if (frame.depth.size() == frame.color.size()) return;
    if (frame.depth.cols * frame.color.rows != frame.depth.rows * frame.color.cols)
      Fail(params_.uri, "expected depth of colour's shape, found " + std::to_string(frame.depth.cols) + "x" +
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
  Library library_;  // Before all that uses it, so that it goes last.
  openni::Device device_;
  Stream color_, depth_;
  geometry::PinholeCamera camera_;
  bool registered_ = false;
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
const std::string& OpenNiSource::uri() const { return implementation_->params().uri; }
bool OpenNiSource::is_recording() const { return implementation_->is_recording(); }
int OpenNiSource::recorded_frames() const { return implementation_->recorded_frames(); }
bool OpenNiSource::registered() const { return implementation_->registered(); }
const geometry::PinholeCamera& OpenNiSource::camera() const { return implementation_->camera(); }

}  // namespace vantage::rgbd
