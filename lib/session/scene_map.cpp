#include "session/scene_map.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "geometry/view_sphere.h"
#include "learning/scene.h"

namespace vantage::session {
namespace {

constexpr int kHullDirections = 96;
constexpr double kSameObjectOverlap = 0.3;  // Of the smaller footprint.
constexpr std::size_t kMaxHulls = 40;

Eigen::AlignedBox2d Footprint(const std::vector<Eigen::Vector3d>& points) {
  Eigen::AlignedBox2d box;
  for (const auto& point : points) box.extend(Eigen::Vector2d(point.head<2>()));
  return box;
}

bool Overlap(const Eigen::AlignedBox2d& a, const Eigen::AlignedBox2d& b) {
  const auto common = a.intersection(b);
  return !common.isEmpty() && common.volume() >= kSameObjectOverlap * std::min(a.volume(), b.volume());
}

}  // namespace

std::vector<Eigen::Vector3d> ExtremePoints(const std::vector<Eigen::Vector3d>& points, int directions) {
  if (points.size() <= static_cast<std::size_t>(directions)) return points;
  std::vector<bool> keep(points.size(), false);
  for (const auto& direction : geometry::EvenDirections(directions)) {
    std::size_t best = 0;
    for (std::size_t i = 1; i < points.size(); ++i) {
      if (points[i].dot(direction) > points[best].dot(direction)) best = i;
    }
    keep[best] = true;
  }
  std::vector<Eigen::Vector3d> extreme;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (keep[i]) extreme.push_back(points[i]);
  }
  return extreme;
}

void SceneMap::Add(const rgbd::Frame& frame, const segmentation::Plane& plane_in_camera,
                   const std::vector<segmentation::Cluster>& clusters) {
  if (!frame.T_world_camera) return;
  if (!plane_) {
    segmentation::Plane plane = plane_in_camera;
    plane.normal = frame.T_world_camera->linear() * plane_in_camera.normal;
    plane.offset_m = plane_in_camera.offset_m - plane.normal.dot(frame.T_world_camera->translation());
    plane_ = plane;
  }
  for (const auto& cluster : clusters) {
    auto points = learning::ClusterHullPoints(frame, plane_in_camera, cluster);
    if (points.size() >= 4) AddHull(std::move(points));
  }
}

void SceneMap::AddHull(std::vector<Eigen::Vector3d> points_in_world) {
  // Growing may make two known hulls one.
  for (auto hull = hulls_.begin(); hull != hulls_.end();) {
    if (Overlap(Footprint(points_in_world), Footprint(hull->points_in_world))) {
      points_in_world.insert(points_in_world.end(), hull->points_in_world.begin(), hull->points_in_world.end());
      hull = hulls_.erase(hull);
    } else {
      ++hull;
    }
  }
  if (hulls_.size() >= kMaxHulls) return;
  hulls_.push_back({"", ExtremePoints(points_in_world, kHullDirections)});
  for (std::size_t i = 0; i < hulls_.size(); ++i) hulls_[i].name = "object " + std::to_string(i);
}

}  // namespace vantage::session
