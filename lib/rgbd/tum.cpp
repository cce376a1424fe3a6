#include "rgbd/tum.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>

namespace vantage::rgbd {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kMaxApart_us = 20000;     // Colour and depth of a frame.
constexpr std::int64_t kMaxPoseGap_us = 100000;  // Poses a frame lies between.

[[noreturn]] void Fail(const fs::path& file, int line, const std::string& what) {
  throw std::runtime_error(file.string() + (line > 0 ? ":" + std::to_string(line) : "") + ": " + what);
}

// Every line that is no comment: time, and the words after it.
std::map<std::int64_t, std::vector<std::string>> ReadList(const fs::path& file, std::size_t words) {
  std::ifstream stream(file);
  if (!stream) Fail(file, 0, "expected a readable list, found none; a TUM RGB-D folder needs it");
  std::map<std::int64_t, std::vector<std::string>> entries;
  std::string text;
  for (int line = 1; std::getline(stream, text); ++line) {
    std::istringstream fields(text);
    double time_s = 0.0;
    if (text.find_first_not_of(" \t\r") == std::string::npos || text[text.find_first_not_of(" \t")] == '#') continue;
    std::vector<std::string> found;
    if (fields >> time_s) {
      for (std::string word; fields >> word;) found.push_back(word);
    }
    if (found.size() != words || !std::isfinite(time_s) || std::abs(time_s) > 1e11) {
      Fail(file, line, "expected a time and " + std::to_string(words) + " words, found '" + text.substr(0, 80) + "'");
    }
    entries[std::llround(time_s * 1e6)] = found;
  }
  return entries;
}

std::map<std::int64_t, geometry::Rigid> ReadPoses(const fs::path& file) {
  std::map<std::int64_t, geometry::Rigid> poses;
  if (!fs::exists(file)) return poses;
  for (const auto& [utime, words] : ReadList(file, 7)) {  // tx ty tz qx qy qz qw
    double numbers[7];
    bool good = true;
    for (std::size_t i = 0; i < 7; ++i) {
      char* end = nullptr;
      numbers[i] = std::strtod(words[i].c_str(), &end);
      good = good && *end == 0 && std::isfinite(numbers[i]);
    }
    const Eigen::Quaterniond turn(numbers[6], numbers[3], numbers[4], numbers[5]);
    if (!good || std::abs(turn.norm() - 1.0) > 0.01) {
      Fail(file, 0, "expected tx ty tz and a unit quaternion at time " + std::to_string(1e-6 * static_cast<double>(utime)));
    }
    geometry::Rigid pose = geometry::Rigid::Identity();
    pose.linear() = turn.normalized().toRotationMatrix();
    pose.translation() = Eigen::Vector3d(numbers[0], numbers[1], numbers[2]);
    poses[utime] = pose;
  }
  return poses;
}

std::optional<geometry::Rigid> PoseAt(const std::map<std::int64_t, geometry::Rigid>& poses, std::int64_t utime) {
  const auto after = poses.lower_bound(utime);
  if (after == poses.end()) return std::nullopt;
  if (after->first == utime) return after->second;
  if (after == poses.begin()) return std::nullopt;
  const auto before = std::prev(after);
  const std::int64_t gap_us = after->first - before->first;
  if (gap_us > kMaxPoseGap_us) return std::nullopt;
  return geometry::Interpolate(before->second, after->second,
                               static_cast<double>(utime - before->first) / static_cast<double>(gap_us));
}

}  // namespace

bool IsTumFolder(const fs::path& folder) { return fs::exists(folder / "rgb.txt") && fs::exists(folder / "depth.txt"); }

std::vector<TumFrame> ReadTum(const fs::path& folder) {
  const auto colors = ReadList(folder / "rgb.txt", 1);
  auto depths = ReadList(folder / "depth.txt", 1);
  const auto poses = ReadPoses(folder / "groundtruth.txt");
  std::vector<TumFrame> frames;
  for (const auto& [utime, words] : colors) {
    auto nearest = depths.lower_bound(utime);
    if (nearest != depths.begin()) {
      const auto before = std::prev(nearest);
      if (nearest == depths.end() || utime - before->first < nearest->first - utime) nearest = before;
    }
    if (nearest == depths.end() || std::abs(nearest->first - utime) > kMaxApart_us) continue;
    frames.push_back({utime, folder / words[0], folder / nearest->second[0], PoseAt(poses, utime)});
    depths.erase(nearest);
  }
  if (frames.empty())
    Fail(folder, 0, "no colour image has a depth image within 20 ms; are rgb.txt and depth.txt of one recording?");
  return frames;
}

geometry::PinholeCamera ReadTumCamera(const fs::path& folder) {
  geometry::PinholeCamera camera{0, 0, 525.0, 525.0, 319.5, 239.5};
  const fs::path file = folder / "calibration.txt";
  if (!fs::exists(file)) return camera;
  std::ifstream stream(file);
  if (!(stream >> camera.fx >> camera.fy >> camera.cx >> camera.cy) || !(camera.fx > 0.0 && camera.fy > 0.0)) {
    Fail(file, 1, "expected fx fy cx cy, focal lengths > 0");
  }
  return camera;
}

}  // namespace vantage::rgbd
