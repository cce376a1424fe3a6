// An OpenNI2 driver whose camera shows the images of a folder, and is unplugged, silent or lossy on command.
//
// $VANTAGE_TEST_CAMERA names a folder with rgb/ and depth/ (16 bit, millimetres), files of the same order in both, shown over and
// over, and a file `control` of lines "KEY NUMBER" that may change at any time (keys: struct Control). Modes: 640x480 and 320x240,
// 30 Hz.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <mutex>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <thread>
#include <vector>

// What the header takes from OpenNI's own build.
#define XN_NEW(type, argument) new type(argument)
#define XN_DELETE(pointer) delete (pointer)
#include <OniDriverAPI.h>

namespace {

using oni::driver::DeviceBase;
using oni::driver::DriverBase;
using oni::driver::StreamBase;

constexpr int kFps = 30;
constexpr int kShiftPx = 12;                       // Of depth that is not registered to colour.
constexpr std::uint64_t kClockStart_us = 5000000;  // A device's clock starts anywhere.
constexpr std::uint64_t kDepthLag_us = 9000;       // Of streams that are not in step.
constexpr int kMaxDepth_mm = 10000;
constexpr float kAcross_rad = 1.0F, kDown_rad = 0.8F;  // Field of view.

struct Control {
  int plugged = 1;
  int address = 1;     // Where it is plugged in: part of the URI "test/camera@ADDRESS".
  int openable = 1;    // 0: no permission.
  int stalled = 0;     // 1: no frames come.
  int hung = 0;        // 1: the camera that is open now sends nothing more, for ever; opened anew it does.
  int drop_color = 0;  // Every n-th colour image is left out; 0: none.
  int drop_depth = 0;
  int registration = 1;   // Whether the device can register depth to colour...
  int sync = 1;           // ...and keep its streams in step.
  int field_of_view = 1;  // 0: the streams say 0.
};

std::filesystem::path Folder() {
  const char* folder = std::getenv("VANTAGE_TEST_CAMERA");
  return folder ? folder : "";
}

Control ReadControl() {
  Control control;
  const std::map<std::string, int*> fields = {{"plugged", &control.plugged},
                                              {"address", &control.address},
                                              {"openable", &control.openable},
                                              {"stalled", &control.stalled},
                                              {"hung", &control.hung},
                                              {"drop_color", &control.drop_color},
                                              {"drop_depth", &control.drop_depth},
                                              {"registration", &control.registration},
                                              {"sync", &control.sync},
                                              {"field_of_view", &control.field_of_view}};
  std::ifstream file(Folder() / "control");
  std::string key;
  int value = 0;
  while (file >> key >> value) {
    if (const auto field = fields.find(key); field != fields.end()) *field->second = value;
  }
  return control;
}

std::vector<cv::Mat> ReadImages(const std::filesystem::path& folder, int flags) {
  std::vector<std::string> files;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator(folder, none)) files.push_back(entry.path().string());
  std::sort(files.begin(), files.end());
  std::vector<cv::Mat> images;
  for (const auto& file : files) images.push_back(cv::imread(file, flags));
  return images;
}

class Stream : public StreamBase {
 public:
  Stream(OniSensorType type, const Control& control) : type_(type), field_of_view_(control.field_of_view != 0) {
    const bool depth = type == ONI_SENSOR_DEPTH;
    mode_ = {depth ? ONI_PIXEL_FORMAT_DEPTH_1_MM : ONI_PIXEL_FORMAT_RGB888, 640, 480, kFps};
  }

  OniStatus getProperty(int property, void* data, int* size) override {
    switch (property) {
      case ONI_STREAM_PROPERTY_VIDEO_MODE:
        return Tell(mode_, data, size);
      case ONI_STREAM_PROPERTY_HORIZONTAL_FOV:
        return Tell(field_of_view_ ? kAcross_rad : 0.0F, data, size);
      case ONI_STREAM_PROPERTY_VERTICAL_FOV:
        return Tell(field_of_view_ ? kDown_rad : 0.0F, data, size);
      case ONI_STREAM_PROPERTY_MIRRORING:
        return Tell(mirrored_, data, size);
      case ONI_STREAM_PROPERTY_CROPPING:  // None; but a recording without this, the stride and the largest value does not play.
        return Tell(OniCropping{}, data, size);
      case ONI_STREAM_PROPERTY_STRIDE:
        return Tell(mode_.resolutionX * (type_ == ONI_SENSOR_DEPTH ? 2 : 3), data, size);
      case ONI_STREAM_PROPERTY_MAX_VALUE:
        return Tell(kMaxDepth_mm, data, size);
      default:
        return ONI_STATUS_NOT_IMPLEMENTED;
    }
  }

  OniStatus setProperty(int property, const void* data, int) override {
    if (property == ONI_STREAM_PROPERTY_VIDEO_MODE) {
      std::memcpy(&mode_, data, sizeof(mode_));
      return ONI_STATUS_OK;
    }
    if (property == ONI_STREAM_PROPERTY_MIRRORING) {
      std::memcpy(&mirrored_, data, sizeof(mirrored_));
      return ONI_STATUS_OK;
    }
    return ONI_STATUS_NOT_IMPLEMENTED;
  }

  OniBool isPropertySupported(int property) override {
    return property == ONI_STREAM_PROPERTY_VIDEO_MODE || property == ONI_STREAM_PROPERTY_MIRRORING ||
           property == ONI_STREAM_PROPERTY_CROPPING || property == ONI_STREAM_PROPERTY_STRIDE ||
           (property == ONI_STREAM_PROPERTY_MAX_VALUE && type_ == ONI_SENSOR_DEPTH) ||
           property == ONI_STREAM_PROPERTY_HORIZONTAL_FOV || property == ONI_STREAM_PROPERTY_VERTICAL_FOV;
  }

  OniStatus start() override {
    running_ = true;
    return ONI_STATUS_OK;
  }
  void stop() override { running_ = false; }

  // Hands the image to OpenNI, as the mode wants it.
  void Show(const cv::Mat& view, int number, std::uint64_t time_us) {
    if (!running_ || view.empty()) return;
    cv::Mat image;
    const bool depth = type_ == ONI_SENSOR_DEPTH;
    cv::resize(view, image, {mode_.resolutionX, mode_.resolutionY}, 0, 0, depth ? cv::INTER_NEAREST : cv::INTER_AREA);
    if (!depth) cv::cvtColor(image, image, cv::COLOR_BGR2RGB);
    if (mirrored_) cv::flip(image, image, 1);
    OniFrame* frame = getServices().acquireFrame();
    if (!frame) return;
    const std::size_t bytes = image.total() * image.elemSize();
    std::memcpy(frame->data, image.data, std::min<std::size_t>(bytes, static_cast<std::size_t>(frame->dataSize)));
    frame->sensorType = type_;
    frame->timestamp = time_us;
    frame->frameIndex = number;
    frame->width = image.cols;
    frame->height = image.rows;
    frame->videoMode = mode_;
    frame->croppingEnabled = FALSE;
    frame->cropOriginX = frame->cropOriginY = 0;
    frame->stride = static_cast<int>(image.step);
    frame->dataSize = static_cast<int>(bytes);
    raiseNewFrame(frame);
    getServices().releaseFrame(frame);
  }

  OniSensorType type() const { return type_; }

 private:
  template <typename Value>
  static OniStatus Tell(const Value& value, void* data, int* size) {
    if (*size != static_cast<int>(sizeof(value))) return ONI_STATUS_BAD_PARAMETER;
    std::memcpy(data, &value, sizeof(value));
    return ONI_STATUS_OK;
  }

  OniSensorType type_;
  OniVideoMode mode_;
  OniBool mirrored_ = TRUE;  // As many a camera starts.
  bool field_of_view_;
  std::atomic<bool> running_{false};
};

class Camera : public DeviceBase {
 public:
  explicit Camera(const Control& control)
      : start_(control),
        color_(ReadImages(Folder() / "rgb", cv::IMREAD_COLOR)),
        depth_(ReadImages(Folder() / "depth", cv::IMREAD_UNCHANGED)) {
    for (const int width : {640, 320}) {
      modes_color_.push_back({ONI_PIXEL_FORMAT_RGB888, width, width * 3 / 4, kFps});
      modes_depth_.push_back({ONI_PIXEL_FORMAT_DEPTH_1_MM, width, width * 3 / 4, kFps});
    }
    sensors_[0] = {ONI_SENSOR_COLOR, static_cast<int>(modes_color_.size()), modes_color_.data()};
    sensors_[1] = {ONI_SENSOR_DEPTH, static_cast<int>(modes_depth_.size()), modes_depth_.data()};
    thread_ = std::thread([this] { Run(); });
  }
  ~Camera() override {
    ended_ = true;
    thread_.join();
  }

  OniStatus getSensorInfoList(OniSensorInfo** sensors, int* count) override {
    *sensors = sensors_;
    *count = 2;
    return ONI_STATUS_OK;
  }
  StreamBase* createStream(OniSensorType type) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    auto* stream = new Stream(type, start_);
    streams_.push_back(stream);
    return stream;
  }
  void destroyStream(StreamBase* stream) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    streams_.erase(std::remove(streams_.begin(), streams_.end(), stream), streams_.end());
    delete stream;
  }

  OniBool isImageRegistrationModeSupported(OniImageRegistrationMode mode) override {
    return mode == ONI_IMAGE_REGISTRATION_OFF || start_.registration != 0;
  }
  OniBool isPropertySupported(int property) override { return property == ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION; }
  OniStatus getProperty(int property, void* data, int* size) override {
    if (property != ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION) return ONI_STATUS_NOT_IMPLEMENTED;
    const OniImageRegistrationMode mode = registration_;
    std::memcpy(data, &mode, std::min(sizeof(mode), static_cast<std::size_t>(*size)));
    return ONI_STATUS_OK;
  }
  OniStatus setProperty(int property, const void* data, int) override {
    if (property != ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION) return ONI_STATUS_NOT_IMPLEMENTED;
    OniImageRegistrationMode mode;
    std::memcpy(&mode, data, sizeof(mode));
    if (!isImageRegistrationModeSupported(mode)) return ONI_STATUS_NOT_SUPPORTED;
    registration_ = mode;
    return ONI_STATUS_OK;
  }

  void SetInStep(bool in_step) { in_step_ = in_step; }
  void Unplug() { unplugged_ = true; }

 private:
  void Run() {
    const auto begin = std::chrono::steady_clock::now();
    bool hung = false;
    for (int number = 1; !ended_; ++number) {
      const auto due = std::chrono::microseconds(static_cast<std::int64_t>(number) * 1000000 / kFps);
      std::this_thread::sleep_until(begin + due);
      const Control control = ReadControl();
      hung = hung || (control.hung && !start_.hung);
      if (unplugged_ || hung || control.stalled || color_.empty() || depth_.empty()) continue;
      const std::uint64_t time_us = kClockStart_us + static_cast<std::uint64_t>(due.count());
      const auto dropped = [number](int every) { return every > 0 && number % every == 0; };
      const std::lock_guard<std::mutex> lock(mutex_);
      for (Stream* stream : streams_) {
        const std::size_t view = static_cast<std::size_t>(number);
        if (stream->type() == ONI_SENSOR_COLOR) {
          if (!dropped(control.drop_color)) stream->Show(color_[view % color_.size()], number, time_us);
        } else if (!dropped(control.drop_depth)) {
          stream->Show(Depth(depth_[view % depth_.size()]), number, time_us + (in_step_ ? 0 : kDepthLag_us));
        }
      }
    }
  }

  cv::Mat Depth(const cv::Mat& registered) const {
    if (registration_ == ONI_IMAGE_REGISTRATION_DEPTH_TO_COLOR) return registered;
    cv::Mat shifted(registered.size(), registered.type(), cv::Scalar(0));
    registered.colRange(0, registered.cols - kShiftPx).copyTo(shifted.colRange(kShiftPx, registered.cols));
    return shifted;
  }

  Control start_;
  std::vector<cv::Mat> color_, depth_;
  std::vector<OniVideoMode> modes_color_, modes_depth_;
  OniSensorInfo sensors_[2];
  std::mutex mutex_;
  std::vector<Stream*> streams_;
  std::atomic<OniImageRegistrationMode> registration_{ONI_IMAGE_REGISTRATION_OFF};
  std::atomic<bool> in_step_{false}, unplugged_{false}, ended_{false};
  std::thread thread_;
};

class Driver : public DriverBase {
 public:
  explicit Driver(OniDriverServices* services) : DriverBase(services) {}

  OniStatus initialize(oni::driver::DeviceConnectedCallback connected, oni::driver::DeviceDisconnectedCallback disconnected,
                       oni::driver::DeviceStateChangedCallback changed, void* cookie) override {
    DriverBase::initialize(connected, disconnected, changed, cookie);
    if (Folder().empty()) return ONI_STATUS_OK;
    Look();
    watcher_ = std::thread([this] {
      while (!ended_) {
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
        Look();
      }
    });
    return ONI_STATUS_OK;
  }

  DeviceBase* deviceOpen(const char* uri, const char*) override {
    const Control control = ReadControl();
    if (!present_ || Uri(control) != uri) return nullptr;
    if (!control.openable) {
      getServices().errorLoggerAppend("Failed to open the USB device: access denied");
      return nullptr;
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    camera_ = new Camera(control);
    return camera_;
  }
  void deviceClose(DeviceBase* device) override {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      camera_ = nullptr;
    }
    delete device;
  }
  void shutdown() override {
    ended_ = true;
    if (watcher_.joinable()) watcher_.join();
  }

  void* enableFrameSync(StreamBase**, int) override { return InStep(true); }
  void disableFrameSync(void*) override { InStep(false); }

 private:
  static std::string Uri(const Control& control) { return "test/camera@" + std::to_string(control.address); }

  void* InStep(bool in_step) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!camera_ || !ReadControl().sync) return nullptr;
    camera_->SetInStep(in_step);
    return this;
  }

  // Tells OpenNI what was plugged in or out since the last look.
  void Look() {
    const Control control = ReadControl();
    const bool moved = present_ && control.address != address_;
    if (present_ && (!control.plugged || moved)) {
      present_ = false;
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (camera_) camera_->Unplug();
      }
      deviceDisconnected(&info_);
    }
    if (!present_ && control.plugged) {
      info_ = {};
      address_ = control.address;
      std::strncpy(info_.uri, Uri(control).c_str(), ONI_MAX_STR - 1);
      std::strncpy(info_.vendor, "Vantage", ONI_MAX_STR - 1);
      std::strncpy(info_.name, "test camera", ONI_MAX_STR - 1);
      present_ = true;
      deviceConnected(&info_);
    }
  }

  std::mutex mutex_;
  Camera* camera_ = nullptr;
  OniDeviceInfo info_{};
  std::atomic<bool> present_{false}, ended_{false};
  std::atomic<int> address_{0};
  std::thread watcher_;
};

}  // namespace

ONI_EXPORT_DRIVER(Driver)
