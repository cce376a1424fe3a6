#include "simulation/recorded_world.h"

#include <limits>
#include <set>
#include <stdexcept>
#include <string>

namespace vantage::simulation {
namespace {

constexpr double kMetresPerRadian = 0.5;  // A turn of 30 degrees counts like a way of 26 cm.
constexpr double kTable_m = 3.0;
constexpr double kSlab_m = 0.04;

}  // namespace

RecordedWorld::RecordedWorld(std::shared_ptr<const rgbd::BopScene> scene, std::vector<int> ids)
    : scene_(std::move(scene)), ids_(std::move(ids)) {
  if (ids_.empty()) throw std::runtime_error(scene_->folder().string() + ": a recorded world needs at least one frame to visit");
  double height_sum_m = 0.0;
  for (int id : ids_) {
    const std::optional<geometry::Rigid> T_recording_camera = scene_->CameraPose(id);
    if (!T_recording_camera)
      throw std::runtime_error(scene_->folder().string() + ": frame " + std::to_string(id) +
                               " has no camera pose; only recordings with poses (cam_R_w2c, cam_t_w2c) can be visited");
    T_world_cameras_.push_back(*T_recording_camera);
    height_sum_m += T_recording_camera->translation().z();
  }
  if (height_sum_m < 0.0) T_world_recording_.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal();
  for (geometry::Rigid& pose : T_world_cameras_) pose = T_world_recording_ * pose;
  camera_ = scene_->Load(ids_.front()).camera;
}

int RecordedWorld::NearestId(const geometry::Rigid& T_world_camera) const {
  int nearest = ids_.front();
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < ids_.size(); ++i) {
    const geometry::PoseDifference difference = geometry::Difference(T_world_camera, T_world_cameras_[i]);
    const double distance = difference.translation_m + kMetresPerRadian * difference.rotation_rad;
    if (distance < least) nearest = ids_[i];
    least = std::min(least, distance);
  }
  return nearest;
}

rgbd::Frame RecordedWorld::Look(const geometry::Rigid& T_world_camera, std::uint32_t /*seed*/) const {
  rgbd::Frame frame = scene_->Load(NearestId(T_world_camera));
  frame.T_world_camera = T_world_recording_ * *frame.T_world_camera;
  return frame;
}

std::vector<geometry::Rigid> RecordedWorld::Viewpoints() const { return T_world_cameras_; }

geometry::Rigid RecordedWorld::StartPose() const { return T_world_cameras_.front(); }

geometry::PinholeCamera RecordedWorld::Camera() const { return camera_; }

motion::Obstacles RecordedWorld::Furniture() const {
  motion::BoxObstacle table;
  table.name = "table";
  table.T_world_box.translation().z() = -kSlab_m / 2;
  table.size_m = {kTable_m, kTable_m, kSlab_m};
  motion::Obstacles furniture;
  furniture.boxes.push_back(table);
  return furniture;
}

std::vector<TrueObject> RecordedWorld::Truth() const {
  std::vector<TrueObject> objects;
  std::set<int> known;
  for (int id : scene_->ids()) {
    const std::optional<geometry::Rigid> T_recording_camera = scene_->CameraPose(id);
    if (!T_recording_camera) continue;
    for (const rgbd::ObjectTruth& truth : scene_->Truth(id)) {
      if (!known.insert(truth.object_id).second) continue;
      TrueObject object;
      object.name = "object_" + std::to_string(truth.object_id);
      object.T_world_object = T_world_recording_ * *T_recording_camera * truth.T_camera_object;
      objects.push_back(object);
    }
  }
  return objects;
}

}  // namespace vantage::simulation
