// Shared by the motion tests: distances worked out by hand, independent of FCL, and seeded random poses.
#pragma once

#include <algorithm>
#include <random>

#include "motion/obstacles.h"

namespace vantage::motion {

// Distance of a point to an axis-aligned box, 0 inside.
inline double DistanceToBox(const Eigen::Vector3d& point, const Eigen::Vector3d& centre, const Eigen::Vector3d& size) {
  return ((point - centre).cwiseAbs() - size / 2.0).cwiseMax(0.0).norm();
}

inline double DistanceToBox(const Eigen::Vector3d& point, const BoxObstacle& box) {
  return DistanceToBox(box.T_world_box.inverse() * point, Eigen::Vector3d::Zero(), box.size_m);
}

inline BoxObstacle Box(const std::string& name, const Eigen::Vector3d& centre, const Eigen::Vector3d& size) {
  BoxObstacle box;
  box.name = name;
  box.T_world_box.translation() = centre;
  box.size_m = size;
  return box;
}

inline std::vector<Eigen::Vector3d> CubeCorners(const Eigen::Vector3d& centre, double edge_m) {
  std::vector<Eigen::Vector3d> corners;
  for (int i = 0; i < 8; ++i) {
    corners.emplace_back(centre + edge_m * Eigen::Vector3d((i & 1) - 0.5, ((i >> 1) & 1) - 0.5, ((i >> 2) & 1) - 0.5));
  }
  return corners;
}

class Random {
 public:
  explicit Random(std::uint32_t seed) : generator_(seed) {}
  double Uniform(double low, double high) { return low + (high - low) * (generator_() / 4294967296.0); }
  Eigen::Vector3d Point(double half_edge_m) {
    const double x = Uniform(-half_edge_m, half_edge_m), y = Uniform(-half_edge_m, half_edge_m);
    return {x, y, Uniform(-half_edge_m, half_edge_m)};
  }
  Eigen::Vector3d Direction() {
    while (true) {
      const Eigen::Vector3d point = Point(1.0);
      if (point.norm() > 0.01 && point.norm() < 1.0) return point.normalized();
    }
  }
  Eigen::Matrix3d Rotation() { return Eigen::AngleAxisd(Uniform(0.0, 3.1), Direction()).toRotationMatrix(); }
  geometry::Rigid Pose(double half_edge_m) {
    geometry::Rigid pose = geometry::Rigid::Identity();
    pose.translation() = Point(half_edge_m);
    pose.linear() = Rotation();
    return pose;
  }

 private:
  std::mt19937 generator_;
};

}  // namespace vantage::motion
