#include "learning/model_edit.h"

#include <algorithm>
#include <set>

namespace vantage::learning {

std::vector<int> DropUnusedPoints(model::ObjectModel* object) {
  std::vector<int> new_index(object->points.size(), -1);
  for (const model::View& view : object->views) {
    for (const int point : view.points) new_index[point] = 0;
  }
  std::vector<model::ModelPoint> kept;
  for (size_t p = 0; p < new_index.size(); ++p) {
    if (new_index[p] < 0) continue;
    new_index[p] = static_cast<int>(kept.size());
    kept.push_back(object->points[p]);
  }
  object->points = std::move(kept);
  for (model::View& view : object->views) {
    for (int& point : view.points) point = new_index[point];
  }
  return new_index;
}

void KeepKeypoints(const std::vector<int>& kept, model::View* view) {
  if (kept.size() == view->points.size()) return;
  view->features = features::Select(view->features, kept);
  std::vector<int> points;
  for (const int k : kept) points.push_back(view->points[k]);
  view->points = std::move(points);
}

Eigen::Vector2d PixelOf(const model::View& view, int keypoint) {
  const cv::Point2f& pixel = view.features.keypoints[keypoint].pt;
  return {pixel.x, pixel.y};
}

int IndexOfView(const model::ObjectModel& object, int id) {
  const auto found = std::lower_bound(object.views.begin(), object.views.end(), id,
                                      [](const model::View& view, int wanted) { return view.id < wanted; });
  return found != object.views.end() && found->id == id ? static_cast<int>(found - object.views.begin()) : -1;
}

int SharedPoints(const model::View& a, const model::View& b) {
  const std::set<int> points_a(a.points.begin(), a.points.end()), points_b(b.points.begin(), b.points.end());
  return static_cast<int>(std::count_if(points_a.begin(), points_a.end(), [&](int point) { return points_b.count(point) > 0; }));
}

}  // namespace vantage::learning
