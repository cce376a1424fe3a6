#include "rgbd/openni/openni_library.h"

#include <algorithm>
#include <stdexcept>

namespace vantage::rgbd {
namespace {

// "1d27/0609@3/12" -> "1d27/0609": what it is, without where it is plugged in.
std::string Kind(const std::string& uri) { return uri.substr(0, uri.find('@')); }

}  // namespace

std::string Complaint() {
  std::string text = openni::OpenNI::getExtendedError();
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c == '\n' || c == '\t' || c == '\r'; }, ' ');
  const std::size_t first = text.find_first_not_of(' '), last = text.find_last_not_of(' ');
  return first == std::string::npos ? "no reason given" : text.substr(first, last - first + 1);
}

void Fail(const std::string& uri, const std::string& what) {
  throw std::runtime_error((uri.empty() ? std::string("OpenNI2 device") : uri) + ": " + what);
}

Library::Library() {
  if (openni::OpenNI::initialize() != openni::STATUS_OK)
    throw std::runtime_error("OpenNI2: expected to start, found: " + Complaint() + "; is libopenni2-0 installed whole?");
}

std::string FindDevice(const std::string& uri, bool elsewhere, std::string& listed) {
  openni::Array<openni::DeviceInfo> devices;
  openni::OpenNI::enumerateDevices(&devices);
  std::string of_the_kind;
  bool there = false;
  for (int i = 0; i < devices.getSize(); ++i) {
    const std::string found = devices[i].getUri();
    there = there || found == uri;
    if ((uri.empty() || (elsewhere && Kind(found) == Kind(uri))) && of_the_kind.empty()) of_the_kind = found;
    listed += (listed.empty() ? "" : ", ") + found;
  }
  if (!there && !of_the_kind.empty()) return of_the_kind;
  if (uri.empty()) FailMissing(uri, listed);
  return uri;
}

void FailMissing(const std::string& uri, const std::string& listed) {
  Fail(uri, "expected a device, found " + (listed.empty() ? "none" : listed) +
                "; is it plugged in, with a driver (scripts/doctor looks for both)? Or name an .oni file");
}

}  // namespace vantage::rgbd
