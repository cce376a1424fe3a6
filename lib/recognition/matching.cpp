#include "recognition/matching.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace vantage::recognition {
namespace {

constexpr double kGroupRadius = 0.008;  // Model points this near (metres) are one place on the object to the ratio test.

// Numbers the places: points nearer than kGroupRadius to a place's first point belong to it.
std::vector<int> GroupPoints(const std::vector<model::ModelPoint>& points) {
  std::map<std::array<int, 3>, std::vector<int>> cells;
  std::vector<int> group(points.size());
  const auto cell_of = [](const Eigen::Vector3d& p, int axis) { return static_cast<int>(std::floor(p[axis] / kGroupRadius)); };
  for (size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d& p = points[i].position;
    int found = -1;
    for (int n = 0; n < 27 && found < 0; ++n) {
      const auto cell = cells.find({cell_of(p, 0) + n % 3 - 1, cell_of(p, 1) + n / 3 % 3 - 1, cell_of(p, 2) + n / 9 - 1});
      if (cell == cells.end()) continue;
      for (const int leader : cell->second) {
        if ((points[leader].position - p).norm() < kGroupRadius) found = leader;
      }
    }
    if (found < 0) {
      found = static_cast<int>(i);
      cells[{cell_of(p, 0), cell_of(p, 1), cell_of(p, 2)}].push_back(found);
    }
    group[i] = found;
  }
  return group;
}

Known Prepare(std::shared_ptr<const model::ObjectModel> object) {
  Known known;
  known.object = object;
  Eigen::Vector3d lower = Eigen::Vector3d::Constant(1e9), upper = -lower;
  for (const model::ModelPoint& point : object->points) {
    lower = lower.cwiseMin(point.position);
    upper = upper.cwiseMax(point.position);
  }
  const Eigen::Vector3d centre = 0.5 * (lower + upper);
  const double radius_m = std::max(0.01, 0.5 * (upper - lower).norm());
  const std::vector<int> group = GroupPoints(object->points);
  for (size_t v = 0; v < object->views.size(); ++v) {
    const model::View& view = object->views[v];
    const Eigen::Vector3d centre_in_camera = view.T_camera_object * centre;
    known.centre_pixel.push_back(view.keyframe.camera.Project(centre_in_camera).value_or(Eigen::Vector2d::Zero()));
    known.radius_px.push_back(view.keyframe.camera.fx * radius_m / std::max(0.05, centre_in_camera.z()));
    for (int k = 0; k < view.features.size(); ++k) {
      known.entries.push_back({static_cast<int>(v), k, view.points[k]});
      known.groups.push_back(group[view.points[k]]);
    }
    known.descriptors.push_back(view.features.descriptors);
  }
  return known;
}

}  // namespace

void Matcher::Set(std::shared_ptr<const model::ObjectModel> object) { objects_[object->name] = Prepare(object); }

void Matcher::Remove(const std::string& name) { objects_.erase(name); }

std::vector<ObjectMatches> Matcher::Match(const features::Features& features) const {
  std::vector<ObjectMatches> found;
  for (const auto& [name, known] : objects_) {
    ObjectMatches& object = found.emplace_back();
    object.known = &known;
    const auto nearest = features::NearestTwo(features.descriptors, known.descriptors, known.groups);
    for (size_t i = 0; i < nearest.size(); ++i) {
      if (nearest[i].best >= 0 && nearest[i].best_distance < max_ratio_ * nearest[i].second_distance) {
        object.matches.push_back({static_cast<int>(i), nearest[i].best});
      }
    }
  }
  return found;
}

}  // namespace vantage::recognition
