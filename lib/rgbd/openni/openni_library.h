// OpenNI2 itself: started and shut down, its complaints, its devices found and lost.
#pragma once

#include <OpenNI.h>

#include <atomic>
#include <string>

namespace vantage::rgbd {

// OpenNI's last complaint on one line.
std::string Complaint();

// Throws std::runtime_error with the device, or file, named first.
[[noreturn]] void Fail(const std::string& uri, const std::string& what);

// OpenNI counts its initialisations; one per source keeps the pairs in step.
class Library {
 public:
  Library();
  ~Library() { openni::OpenNI::shutdown(); }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;
};

// Hears when a device is unplugged, from a thread of OpenNI's.
class GoneListener : public openni::OpenNI::DeviceDisconnectedListener {
 public:
  explicit GoneListener(std::string uri) : uri_(std::move(uri)) { openni::OpenNI::addDeviceDisconnectedListener(this); }
  ~GoneListener() { openni::OpenNI::removeDeviceDisconnectedListener(this); }
  void onDeviceDisconnected(const openni::DeviceInfo* device) override {
    if (uri_ == device->getUri()) gone_ = true;
  }
  bool gone() const { return gone_; }

 private:
  std::string uri_;
  std::atomic<bool> gone_{false};
};

// The URI of the device that is meant: `uri` itself, the first there is where it is empty, or, if `elsewhere`, one of the same
// kind at another port. `listed`: of all that OpenNI knows (it may open others), for people.
std::string FindDevice(const std::string& uri, bool elsewhere, std::string& listed);

[[noreturn]] void FailMissing(const std::string& uri, const std::string& listed);

}  // namespace vantage::rgbd
