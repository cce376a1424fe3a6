#include "learning/scene.h"

#include <algorithm>
#include <cmath>

namespace vantage::learning {

std::vector<Eigen::Vector3d> ClusterHullPoints(const rgbd::Frame& frame, const segmentation::Plane& plane,
                                               const segmentation::Cluster& cluster, int max_points) {
  std::vector<Eigen::Vector3d> points;
  if (!frame.T_world_camera) return points;
  const int step = std::max(1, static_cast<int>(std::sqrt(2.0 * cluster.box.area() / std::max(1, max_points))));
  for (int y = cluster.box.y; y < cluster.box.br().y; y += step) {
    for (int x = cluster.box.x; x < cluster.box.br().x; x += step) {
      if (!cluster.mask.at<uchar>(y, x)) continue;
      const auto point = rgbd::PointAt(frame, {x, y}, 0);
      if (!point) continue;
      points.push_back(*frame.T_world_camera * *point);
      points.push_back(*frame.T_world_camera * (*point - plane.Height(*point) * plane.normal));
    }
  }
  return points;
}

}  // namespace vantage::learning
