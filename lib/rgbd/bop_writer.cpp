#include "rgbd/bop_writer.h"

#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

namespace vantage::rgbd {
namespace {

namespace fs = std::filesystem;

std::string Name(int id, const char* extension) {
  char name[32];
  std::snprintf(name, sizeof(name), "%06d%s", id, extension);
  return name;
}

void WriteFile(const fs::path& file, const void* data, std::size_t size) {
  std::ofstream stream(file, std::ios::binary);
  stream.write(static_cast<const char*>(data), static_cast<std::streamsize>(size));
  stream.close();
  if (!stream) throw std::runtime_error(file.string() + ": cannot be written; is the disk full?");
}

bool IsJpeg(const Bytes& bytes) { return bytes.size() > 2 && bytes[0] == 0xFF && bytes[1] == 0xD8; }

std::string CameraEntry(const Frame& frame) {
  const geometry::PinholeCamera& camera = frame.camera;
  nlohmann::ordered_json entry;
  entry["cam_K"] = {camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0};
  entry["depth_scale"] = 1.0;
  if (frame.T_world_camera) {
    const geometry::Rigid T_camera_world = frame.T_world_camera->inverse();
    entry["cam_R_w2c"] = nlohmann::ordered_json::array();
    for (int i = 0; i < 9; ++i) entry["cam_R_w2c"].push_back(T_camera_world.linear()(i / 3, i % 3));
    const Eigen::Vector3d t_mm = 1000.0 * T_camera_world.translation();
    entry["cam_t_w2c"] = {t_mm.x(), t_mm.y(), t_mm.z()};
  }
  return entry.dump();
}

}  // namespace

BopWriter::BopWriter(const fs::path& folder) : folder_(folder) {
  if (fs::exists(folder / "scene_camera.json")) {
    throw std::runtime_error(folder.string() + ": holds a scene already; choose another folder");
  }
  std::error_code failed;
  fs::create_directories(folder / "rgb", failed);
  if (!failed) fs::create_directories(folder / "depth", failed);
  if (failed) throw std::runtime_error(folder.string() + ": cannot be made: " + failed.message());
}

void BopWriter::Add(int id, const Frame& frame, const Bytes& color) {
  CheckFrame(frame);
  if (id < 0 || id > 999999 || cameras_.count(id)) throw std::invalid_argument("frame number " + std::to_string(id));
  Bytes bytes = color.empty() ? EncodeColorLossless(frame.color) : color;
  WriteFile(folder_ / "rgb" / Name(id, IsJpeg(bytes) ? ".jpg" : ".png"), bytes.data(), bytes.size());
  if (!frame.depth.empty()) {
    cv::imencode(".png", frame.depth, bytes);
    WriteFile(folder_ / "depth" / Name(id, ".png"), bytes.data(), bytes.size());
  }
  cameras_[id] = CameraEntry(frame);
}

void BopWriter::Finish() {
  std::error_code ignored;
  fs::remove(folder_ / "depth", ignored);  // Goes only where it is empty: no depth at all.
  std::string text = "{";
  for (const auto& [id, entry] : cameras_) text += (text.size() > 1 ? ",\n" : "\n") + ("\"" + std::to_string(id)) + "\": " + entry;
  text += "\n}\n";
  WriteFile(folder_ / "scene_camera.json", text.data(), text.size());
}

}  // namespace vantage::rgbd
