// What stands on the table, gathered over views: every object one hull, grown as it is seen from more sides.
#pragma once

#include <optional>
#include <vector>

#include "motion/obstacles.h"
#include "rgbd/frame.h"
#include "segmentation/clusters.h"

namespace vantage::session {

class SceneMap {
 public:
  // Adds what one frame showed. Does nothing where the frame's camera pose is not known.
  void Add(const rgbd::Frame& frame, const segmentation::Plane& plane_in_camera,
           const std::vector<segmentation::Cluster>& clusters);

  bool empty() const { return !plane_.has_value(); }
  const std::optional<segmentation::Plane>& plane_in_world() const { return plane_; }
  const std::vector<motion::HullObstacle>& hulls() const { return hulls_; }

 private:
  void AddHull(std::vector<Eigen::Vector3d> points_in_world);

  std::optional<segmentation::Plane> plane_;
  std::vector<motion::HullObstacle> hulls_;
};

// The points that are extreme in one of `directions` even directions: a small set with nearly the same hull.
std::vector<Eigen::Vector3d> ExtremePoints(const std::vector<Eigen::Vector3d>& points, int directions);

}  // namespace vantage::session
