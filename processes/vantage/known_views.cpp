#include "vantage/known_views.h"

#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "geometry/view_sphere.h"
#include "learning/keyframe.h"
#include "vantage/sequence.h"

namespace vantage::cli {
namespace {

constexpr int kMinViewPoints = 20;
constexpr int kSurfaceStep = 12;  // Every so manieth pixel of every so manieth row is a point of the true surface.
const char* const kName = "object";

// Of simulated looks.
constexpr double kMinElevationRad = 15.0 * M_PI / 180.0;
constexpr double kMaxElevationRad = 75.0 * M_PI / 180.0;
constexpr double kMaxRollRad = 15.0 * M_PI / 180.0;
constexpr std::array kDistancesM = {0.45, 0.6, 0.8};
const Eigen::Vector3d kCarriedM(0.23, -0.14, 0.0);  // Before those that judge.

}  // namespace

RecordedObject::RecordedObject(const rgbd::BopScene& scene, int object_id) : scene_(scene), object_id_(object_id) {
  const auto label = LabelOfObject(scene, object_id);
  if (!label) throw std::runtime_error(scene.folder().string() + ": has no label/; learning at known poses needs it");
  label_ = *label;
}

cv::Mat RecordedObject::Mask(int id) const { return scene_.LoadLabel(id) == label_; }

std::optional<geometry::Rigid> RecordedObject::TruePose(int id) const { return TruthOf(scene_, id, object_id_); }

Eigen::Matrix3Xd KnownFrames::Surface(const std::vector<int>& ids) const {
  std::vector<Eigen::Vector3d> points;
  for (const int id : ids) {
    const auto T_camera_mesh = TruePose(id);
    if (!T_camera_mesh) continue;
    const rgbd::Frame frame = Load(id);
    const cv::Mat mask = Mask(id);
    for (int y = 0; y < mask.rows && !frame.depth.empty(); y += kSurfaceStep) {
      for (int x = 0; x < mask.cols; x += kSurfaceStep) {
        if (mask.at<uchar>(y, x) == 0) continue;
        if (const auto point = rgbd::PointAt(frame, {x, y})) points.push_back(T_camera_mesh->inverse() * *point);
      }
    }
  }
  if (points.empty()) {
    throw std::runtime_error(Where() + ": no frame has depth on the object; its true surface is not known");
  }
  return Eigen::Map<const Eigen::Matrix3Xd>(points[0].data(), 3, static_cast<Eigen::Index>(points.size()));
}

model::ObjectModel KnownFrames::Learn(const std::vector<int>& ids, const features::FeatureParams& params,
                                      const geometry::Rigid& T_mesh_object) const {
  model::ObjectModel object;
  object.name = kName;
  object.feature_fingerprint = params.Fingerprint();
  for (const int id : ids) {
    const auto T_camera_mesh = TruePose(id);
    cv::Mat mask;  // Of its own: Mask() may lend its pixels.
    cv::erode(Mask(id), mask, cv::Mat(), cv::Point(-1, -1), mask_error_px());
    if (!T_camera_mesh || cv::countNonZero(mask) == 0) continue;
    const rgbd::Frame frame = Load(id);
    const features::Features features = features::Extract(rgbd::Gray(frame), mask, params);
    auto extended = learning::WithView(object, frame, mask, features, *T_camera_mesh * T_mesh_object, {}, kMinViewPoints);
    if (extended) object = std::move(*extended);
  }
  return object;
}

SimulatedObject::SimulatedObject(const simulation::WorldParams& params, int frames, const std::vector<int>& carried,
                                 double turned_rad, std::uint32_t seed)
    : world_(params), seed_(seed * 7919u), frames_(static_cast<std::size_t>(frames)), masks_(frames_.size()) {
  const simulation::TrueObject truth = world_.Truth().at(0);
  name_ = truth.name;
  const geometry::Rigid carry = Eigen::Translation3d(kCarriedM) * Eigen::AngleAxisd(turned_rad, Eigen::Vector3d::UnitZ());
  T_world_mesh_.assign(frames_.size(), truth.T_world_object);
  for (const int id : carried) T_world_mesh_.at(static_cast<std::size_t>(id)) = carry * truth.T_world_object;
  const Eigen::Vector3d middle_in_mesh = truth.points.rowwise().mean();
  const auto directions = geometry::EvenDirections(frames);
  const double z_min = std::sin(kMinElevationRad), z_max = std::sin(kMaxElevationRad);
  for (int id = 0; id < frames; ++id) {
    const auto i = static_cast<std::size_t>(id);
    world_.MoveObject(0, T_world_mesh_[i]);
    const Eigen::Vector3d middle = T_world_mesh_[i] * middle_in_mesh;
    const double z = z_min + (z_max - z_min) * 0.5 * (directions[i].z() + 1.0), across = std::sqrt(1.0 - z * z);
    const double azimuth = geometry::Azimuth(directions[i]);
    // Distances change with every second frame, so that even and odd ids have all of them.
    const double distance_m = kDistancesM[i / 2 % kDistancesM.size()];
    const Eigen::Vector3d eye = middle + distance_m * Eigen::Vector3d(across * std::cos(azimuth), across * std::sin(azimuth), z);
    const double roll = kMaxRollRad * std::sin(2.4 * id);
    const geometry::Rigid T_world_camera =
        geometry::LookAt(eye, middle, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ());
    frames_[i] = world_.Look(T_world_camera, seed_ + static_cast<std::uint32_t>(id));
    frames_[i].id = id;
    frames_[i].utime = id;
    masks_[i] = world_.Labels(T_world_camera) == 0;
    ids_.push_back(id);
  }
}

rgbd::Frame SimulatedObject::Without(int id) {
  world_.ShowObject(0, false);
  rgbd::Frame frame =
      world_.Look(*frames_.at(static_cast<std::size_t>(id)).T_world_camera, ~seed_ + static_cast<std::uint32_t>(id));
  world_.ShowObject(0, true);
  frame.id = id;
  frame.utime = id;
  return frame;
}

std::optional<geometry::Rigid> SimulatedObject::TruePose(int id) const {
  return frames_.at(static_cast<std::size_t>(id)).T_world_camera->inverse() * T_world_mesh_[static_cast<std::size_t>(id)];
}

}  // namespace vantage::cli
