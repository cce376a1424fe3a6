// What a moving camera must not touch: the table, convex hulls of objects, walls (FCL).
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "geometry/rigid.h"

namespace vantage::motion {

// An oriented box; walls and table tops are thin boxes.
struct BoxObstacle {
  std::string name;
  geometry::Rigid T_world_box = geometry::Rigid::Identity();
  Eigen::Vector3d size_m = Eigen::Vector3d::Ones();  // Full edge lengths, each > 0.
};

// The convex hull of some points; at least 4 that are not in one plane (else it is thickened by 1 mm).
struct HullObstacle {
  std::string name;
  std::vector<Eigen::Vector3d> points_in_world;
};

struct Obstacles {
  std::vector<BoxObstacle> boxes;
  std::vector<HullObstacle> hulls;
};

// Static collision world with one moving body: a sphere of `radius_m` around the camera's origin.
class CollisionWorld {
 public:
  CollisionWorld(const Obstacles& obstacles, double radius_m);
  ~CollisionWorld();
  CollisionWorld(CollisionWorld&&) noexcept;
  CollisionWorld& operator=(CollisionWorld&&) noexcept;

  bool IsFree(const Eigen::Vector3d& position_in_world) const;
  // Distance from the body's surface to the nearest obstacle, metres, <= 0 where it touches; +inf without obstacles.
  double Clearance(const Eigen::Vector3d& position_in_world) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vantage::motion
