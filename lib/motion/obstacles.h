// What a moving camera must not touch: the table, convex hulls of objects, walls (FCL).
//
// Coordinates are world, metres. Obstacles never move; make a new world for a new scene. Queries are const and may run in several
// threads; each costs microseconds.
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

// The convex hull of some points, at least one; where they lie in a plane, line or point it is thickened to 1 mm.
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
  // Throws std::invalid_argument, naming the obstacle, where a size is not > 0, a hull has no points or a number is not finite;
  // or where radius_m is not > 0.
  CollisionWorld(const Obstacles& obstacles, double radius_m);
  ~CollisionWorld();
  CollisionWorld(CollisionWorld&&) noexcept;
  CollisionWorld& operator=(CollisionWorld&&) noexcept;

  bool IsFree(const Eigen::Vector3d& position_in_world) const;
  // Whether the straight move is free all the way: the swept sphere (a capsule) is tested at once, so nothing thin is stepped over.
  bool IsMoveFree(const Eigen::Vector3d& from_in_world, const Eigen::Vector3d& to_in_world) const;
  // Distance from the body's surface to the nearest obstacle, metres, to 0.01 mm; <= 0 where it touches, -radius_m where the
  // centre is inside; +inf without obstacles.
  double Clearance(const Eigen::Vector3d& position_in_world) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vantage::motion
