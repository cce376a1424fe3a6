#include "model/object_model.h"

#include <algorithm>

namespace vantage::model {

measures::Viewpoint View::viewpoint() const {
  const Eigen::Vector3d camera = T_camera_object.inverse().translation();
  return {camera.normalized(), camera.norm()};
}

ObjectModel ObjectModel::OnlyViews(const std::vector<int>& wanted) const {
  ObjectModel part;
  part.name = name;
  part.measures = measures;
  part.feature_fingerprint = feature_fingerprint;
  std::vector<int> renumbered(points.size(), -1);
  for (const int index : wanted) {
    View view = views[index];
    for (int& point : view.points) {
      if (renumbered[point] < 0) {
        renumbered[point] = static_cast<int>(part.points.size());
        part.points.push_back(points[point]);
      }
      point = renumbered[point];
    }
    part.views.push_back(std::move(view));
  }
  return part;
}

ObjectModel ObjectModel::OnlyView(int view) const { return OnlyViews({view}); }

std::vector<measures::Viewpoint> ObjectModel::viewpoints() const {
  std::vector<measures::Viewpoint> viewpoints;
  for (const View& view : views) viewpoints.push_back(view.viewpoint());
  return viewpoints;
}

Eigen::Matrix3Xd ObjectModel::PointMatrix() const {
  Eigen::Matrix3Xd matrix(3, points.size());
  for (size_t i = 0; i < points.size(); ++i) matrix.col(i) = points[i].position;
  return matrix;
}

double MeanPointDistance(const Eigen::Matrix3Xd& points_in_object, const geometry::Rigid& a, const geometry::Rigid& b) {
  if (points_in_object.cols() == 0) return 0.0;
  return (a * points_in_object - b * points_in_object).colwise().norm().mean();
}

}  // namespace vantage::model
