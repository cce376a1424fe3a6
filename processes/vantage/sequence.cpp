#include "vantage/sequence.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace vantage::cli {
namespace {

constexpr int kLabelVotes = 30;    // Frames that say which label is the object's.
constexpr double kInsidePx = 2.0;  // A target pixel is at least this far inside the object.

std::optional<Eigen::Vector2d> ProjectedOrigin(const rgbd::BopScene& scene, const rgbd::Frame& frame, int object_id) {
  const auto T_camera_mesh = TruthOf(scene, static_cast<int>(frame.id), object_id);
  if (!T_camera_mesh) return std::nullopt;
  auto pixel = frame.camera.Project(T_camera_mesh->translation());
  if (!pixel || !frame.camera.Contains(*pixel)) return std::nullopt;
  return pixel;
}

}  // namespace

std::vector<int> FramesOf(const rgbd::BopScene& scene, const std::string& selection) {
  std::vector<int> ids;
  try {
    ids = rgbd::SelectFrames(scene.ids(), selection);
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(std::string("--frames: ") + error.what());
  }
  if (ids.empty()) throw std::runtime_error(scene.folder().string() + ": --frames " + selection + " leaves no frame");
  return ids;
}

std::string NameOfFolder(const std::string& folder) {
  std::filesystem::path path = std::filesystem::weakly_canonical(folder);
  if (!path.has_filename()) path = path.parent_path();
  const std::string name = path.filename().string();
  return name.empty() ? "object" : name;
}

std::optional<geometry::Rigid> TruthOf(const rgbd::BopScene& scene, int id, int object_id) {
  for (const rgbd::ObjectTruth& truth : scene.Truth(id)) {
    if (truth.object_id == object_id) return truth.T_camera_object;
  }
  return std::nullopt;
}

KnownPose KnownPoseOf(const rgbd::BopScene& scene, const rgbd::Frame& frame, std::optional<int> object_id) {
  KnownPose known;
  if (object_id) known.T_camera_mesh = TruthOf(scene, static_cast<int>(frame.id), *object_id);
  known.T_world_camera = frame.T_world_camera;
  return known;
}

std::optional<geometry::Rigid> MotionBetween(const KnownPose& from, const KnownPose& to) {
  if (from.T_camera_mesh && to.T_camera_mesh) return *to.T_camera_mesh * from.T_camera_mesh->inverse();
  if (from.T_world_camera && to.T_world_camera) return to.T_world_camera->inverse() * *from.T_world_camera;
  return std::nullopt;
}

std::optional<int> LabelOfObject(const rgbd::BopScene& scene, int object_id) {
  std::vector<int> listed;
  for (const int id : scene.ids()) {
    if (TruthOf(scene, id, object_id)) listed.push_back(id);
  }
  if (listed.empty()) {
    throw std::runtime_error((scene.folder() / "scene_gt.json").string() + ": does not list object " + std::to_string(object_id) +
                             "; choose another --object-id, or say where it is with --object-pixel U,V");
  }
  std::map<int, int> votes;
  const std::size_t step = std::max<std::size_t>(1, listed.size() / kLabelVotes);
  for (std::size_t i = 0; i < listed.size(); i += step) {
    const cv::Mat label = scene.LoadLabel(listed[i]);
    if (label.empty()) return std::nullopt;
    if (const auto pixel = ProjectedOrigin(scene, scene.Load(listed[i]), object_id)) {
      ++votes[label.at<uchar>(cv::Point(static_cast<int>(pixel->x()), static_cast<int>(pixel->y())))];
    }
  }
  votes.erase(0);  // The table, or nothing.
  const auto most = std::max_element(votes.begin(), votes.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  if (most == votes.end()) return std::nullopt;
  return most->first;
}

std::optional<Eigen::Vector2d> PixelOfObject(const rgbd::BopScene& scene, int id, int object_id, std::optional<int> label) {
  if (!label) return ProjectedOrigin(scene, scene.Load(id), object_id);
  cv::Mat distance;
  cv::distanceTransform(scene.LoadLabel(id) == *label, distance, cv::DIST_L2, cv::DIST_MASK_3);
  double inside_px = 0.0;
  cv::Point pixel;
  cv::minMaxLoc(distance, nullptr, &inside_px, nullptr, &pixel);
  if (inside_px < kInsidePx) return std::nullopt;
  return Eigen::Vector2d(pixel.x, pixel.y);
}

}  // namespace vantage::cli
