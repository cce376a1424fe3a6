#include "rgbd/bop.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

namespace vantage::rgbd {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr double kMetresPerMillimetre = 0.001;
constexpr std::int64_t kFrameInterval_us = 33333;

[[noreturn]] void Fail(const fs::path& file, const std::string& what) { throw std::runtime_error(file.string() + ": " + what); }

json ReadJson(const fs::path& file) {
  std::ifstream stream(file);
  if (!stream) Fail(file, "expected a readable file, found none; a BOP scene folder needs it");
  try {
    return json::parse(stream);
  } catch (const json::exception& error) {
    Fail(file, std::string("expected valid JSON, found: ") + error.what() + "; mend the file or fetch the recording again");
  }
}

// Where in a JSON file a value was expected: keeps the error messages alike.
struct Place {
  const fs::path& file;
  const std::string& frame;

  [[noreturn]] void Wrong(const std::string& key, const std::string& expected, const json& entry) const {
    const std::string found = entry.is_object() && entry.contains(key) ? entry.at(key).dump().substr(0, 80) : "nothing";
    Fail(file, "frame " + frame + ": expected " + key + " to be " + expected + ", found " + found + "; mend the entry");
  }
};

std::vector<double> Numbers(const Place& place, const json& entry, const std::string& key, std::size_t count) {
  const auto value = entry.is_object() ? entry.find(key) : entry.end();
  bool good = entry.is_object() && value != entry.end() && value->is_array() && value->size() == count;
  std::vector<double> numbers;
  for (std::size_t i = 0; good && i < count; ++i) {
    good = (*value)[i].is_number() && std::isfinite((*value)[i].get<double>());
    if (good) numbers.push_back((*value)[i].get<double>());
  }
  if (!good) place.Wrong(key, std::to_string(count) + " numbers", entry);
  return numbers;
}

// The transform of a rotation (9 numbers, row-major) and a translation (3 numbers, mm).
geometry::Rigid ReadRigid(const Place& place, const json& entry, const std::string& rotation_key,
                          const std::string& translation_key) {
  const std::vector<double> r = Numbers(place, entry, rotation_key, 9);
  const std::vector<double> t = Numbers(place, entry, translation_key, 3);
  const Eigen::Matrix3d rotation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(r.data());
  if ((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm() > 1e-2 || rotation.determinant() < 0.0)
    place.Wrong(rotation_key, "a rotation matrix", entry);
  geometry::Rigid rigid = geometry::Rigid::Identity();
  rigid.linear() = Eigen::Quaterniond(rotation).normalized().toRotationMatrix();  // The text has few digits.
  rigid.translation() = kMetresPerMillimetre * Eigen::Map<const Eigen::Vector3d>(t.data());
  return rigid;
}

int FrameId(const fs::path& file, const std::string& text) {
  const bool digits = !text.empty() && text.size() <= 9 && text.find_first_not_of("0123456789") == std::string::npos;
  if (!digits) Fail(file, "expected frame numbers as keys, found \"" + text + "\"; mend the key");
  return std::stoi(text);
}

// JSON objects only: what the top level of both files must be.
void RequireObject(const fs::path& file, const json& root) {
  if (!root.is_object()) Fail(file, std::string("expected an object of frames, found ") + root.type_name() + "; mend the file");
}

std::string Name(int id, const char* extension) {
  char name[32];
  std::snprintf(name, sizeof(name), "%06d%s", id, extension);
  return name;
}

std::string Size(const cv::Mat& image) { return std::to_string(image.cols) + "x" + std::to_string(image.rows); }

cv::Mat ReadImage(const fs::path& file, int flags) {
  if (!fs::exists(file))
    Fail(file, "expected an image, found no such file; restore it or leave the frame out of scene_camera.json");
  cv::Mat image;
  try {
    image = cv::imread(file.string(), flags | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception& error) {
    Fail(file, "expected an image, found what cannot be decoded (" + error.err + "); restore the file");
  }
  if (image.empty()) Fail(file, "expected an image, found a file that is none or is cut off; restore the file");
  return image;
}

fs::path ColorFile(const fs::path& folder, int id) {
  for (const char* extension : {".jpg", ".png", ".jpeg"}) {
    const fs::path file = folder / "rgb" / Name(id, extension);
    if (fs::exists(file)) return file;
  }
  return folder / "rgb" / Name(id, ".jpg");  // Its absence is reported where it is read.
}

// Depth of a file as uint16 millimetres.
cv::Mat ReadDepth(const fs::path& file, double depth_scale) {
  const cv::Mat raw = ReadImage(file, cv::IMREAD_UNCHANGED);
  if (raw.type() != CV_16UC1)
    Fail(file, "expected 16-bit depth in one channel, found " + cv::typeToString(raw.type()) + "; store depth as 16-bit PNG");
  if (depth_scale == 1.0) return raw;
  cv::Mat depth;
  raw.convertTo(depth, CV_16UC1, depth_scale);  // Rounds to the nearest millimetre.
  depth.setTo(0, raw > 65535.0 / depth_scale);  // Beyond the range: none, not the largest.
  return depth;
}

}  // namespace

BopScene::BopScene(const fs::path& folder) : folder_(folder) {
  if (!fs::is_directory(folder)) Fail(folder, "expected a BOP scene folder, found no such folder; check the path");
  const fs::path camera_file = folder / "scene_camera.json";
  if (!fs::exists(camera_file) && IsTumFolder(folder)) {
    OpenTum();
    return;
  }
  const json cameras = ReadJson(camera_file);
  RequireObject(camera_file, cameras);
  for (const auto& [key, entry] : cameras.items()) {
    const Place place{camera_file, key};
    const int id = FrameId(camera_file, key);
    CameraEntry camera;
    const std::vector<double> k = Numbers(place, entry, "cam_K", 9);
    camera.camera.fx = k[0], camera.camera.cx = k[2], camera.camera.fy = k[4], camera.camera.cy = k[5];
    if (k[0] <= 0.0 || k[4] <= 0.0) place.Wrong("cam_K", "9 numbers with focal lengths > 0", entry);
    if (entry.contains("depth_scale")) {
      const json& scale = entry.at("depth_scale");
      if (!scale.is_number() || !(scale.get<double>() > 0.0)) place.Wrong("depth_scale", "a number > 0", entry);
      camera.depth_scale = scale.get<double>();
    }
    if (entry.contains("cam_R_w2c") || entry.contains("cam_t_w2c"))
      camera.T_world_camera = ReadRigid(place, entry, "cam_R_w2c", "cam_t_w2c").inverse();
    cameras_[id] = camera;
  }
  if (cameras_.empty()) Fail(camera_file, "expected at least one frame, found none; is this the right folder?");
  for (const auto& item : cameras_) ids_.push_back(item.first);

  const fs::path truth_file = folder / "scene_gt.json";
  if (!fs::exists(truth_file)) return;
  const json truth = ReadJson(truth_file);
  RequireObject(truth_file, truth);
  for (const auto& [key, entries] : truth.items()) {
    const Place place{truth_file, key};
    std::vector<ObjectTruth>& objects = truth_[FrameId(truth_file, key)];
    if (!entries.is_array())
      Fail(truth_file, "frame " + key + ": expected a list of objects, found " + entries.type_name() + "; mend it");
    for (const json& entry : entries) {
      if (!entry.is_object() || !entry.contains("obj_id") || !entry.at("obj_id").is_number_integer())
        place.Wrong("obj_id", "an integer", entry);
      objects.push_back({entry.at("obj_id").get<int>(), ReadRigid(place, entry, "cam_R_m2c", "cam_t_m2c")});
    }
  }
}

void BopScene::OpenTum() {
  CameraEntry entry;
  entry.camera = ReadTumCamera(folder_);
  entry.depth_scale = kTumDepthScale_mm;
  for (TumFrame& frame : ReadTum(folder_)) {
    entry.T_world_camera = frame.T_world_camera;
    entry.tum = std::move(frame);
    ids_.push_back(static_cast<int>(ids_.size()));
    cameras_[ids_.back()] = entry;
  }
}

Frame BopScene::Load(int id) const {
  const auto found = cameras_.find(id);
  if (found == cameras_.end())
    Fail(folder_ / "scene_camera.json", "expected frame " + std::to_string(id) + ", found frames " + std::to_string(ids_.front()) +
                                            " to " + std::to_string(ids_.back()) + " without it; ask for one that is there");
  const CameraEntry& entry = found->second;
  Frame frame;
  frame.id = id;
  frame.utime = entry.tum ? entry.tum->utime : id * kFrameInterval_us;
  frame.T_world_camera = entry.T_world_camera;
  frame.color = ReadImage(entry.tum ? entry.tum->color : ColorFile(folder_, id), cv::IMREAD_COLOR);
  frame.camera = entry.camera;
  frame.camera.width = frame.color.cols;
  frame.camera.height = frame.color.rows;
  if (entry.tum || fs::is_directory(folder_ / "depth")) {
    const fs::path file = entry.tum ? entry.tum->depth : folder_ / "depth" / Name(id, ".png");
    frame.depth = ReadDepth(file, entry.depth_scale);
    if (frame.depth.size() != frame.color.size())
      Fail(file, "expected depth as large as colour (" + Size(frame.color) + "), found " + Size(frame.depth) +
                     "; register depth to the colour image");
  }
  return frame;
}

cv::Mat BopScene::LoadLabel(int id) const {
  if (!fs::is_directory(folder_ / "label")) return {};
  const fs::path file = folder_ / "label" / Name(id, ".png");
  const cv::Mat label = ReadImage(file, cv::IMREAD_UNCHANGED);
  if (label.type() != CV_8UC1)
    Fail(file, "expected 8-bit labels in one channel, found " + cv::typeToString(label.type()) + "; convert it");
  return label;
}

std::optional<geometry::Rigid> BopScene::CameraPose(int id) const {
  const auto found = cameras_.find(id);
  return found == cameras_.end() ? std::nullopt : found->second.T_world_camera;
}

const std::vector<ObjectTruth>& BopScene::Truth(int id) const {
  static const std::vector<ObjectTruth> kNone;
  const auto found = truth_.find(id);
  return found == truth_.end() ? kNone : found->second;
}

std::vector<int> SelectFrames(const std::vector<int>& ids, const std::string& selection) {
  const auto wrong = [&]() {
    return std::invalid_argument("frames: expected all, even, odd or A:B (frame numbers, either may be empty), found \"" +
                                 selection + "\"");
  };
  const auto number = [&](const std::string& text, int otherwise) {
    if (text.empty()) return otherwise;
    if (text.size() > 9 || text.find_first_not_of("0123456789") != std::string::npos) throw wrong();
    return std::stoi(text);
  };
  std::vector<int> chosen;
  const auto keep = [&](auto wanted) { std::copy_if(ids.begin(), ids.end(), std::back_inserter(chosen), wanted); };
  if (selection == "all") return ids;
  if (selection == "even" || selection == "odd") {
    const int remainder = selection == "odd" ? 1 : 0;
    keep([&](int id) { return std::abs(id) % 2 == remainder; });
    return chosen;
  }
  const std::size_t colon = selection.find(':');
  if (colon == std::string::npos) throw wrong();
  const int first = number(selection.substr(0, colon), std::numeric_limits<int>::min());
  const int end = number(selection.substr(colon + 1), std::numeric_limits<int>::max());
  keep([&](int id) { return id >= first && id < end; });
  return chosen;
}

}  // namespace vantage::rgbd
