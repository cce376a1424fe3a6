#include "motion/obstacles.h"

#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/broadphase/default_broadphase_callbacks.h>
#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/capsule.h>
#include <fcl/geometry/shape/convex.h>
#include <fcl/geometry/shape/sphere.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/collision_object.h>
#include <fcl/narrowphase/distance.h>

#include <limits>
#include <stdexcept>

#include "motion/collision_shapes.h"
#include "motion/hull.h"

namespace vantage::motion {
namespace {

using Object = fcl::CollisionObject<double>;

std::shared_ptr<Object> MakeBox(const BoxObstacle& box) {
  if (!box.size_m.allFinite() || box.size_m.minCoeff() <= 0.0 || !box.T_world_box.matrix().allFinite()) {
    throw std::invalid_argument("obstacle box '" + box.name + "': size_m must be > 0 and its pose finite");
  }
  return std::make_shared<Object>(std::make_shared<fcl::Box<double>>(box.size_m), box.T_world_box);
}

std::shared_ptr<Object> MakeHull(const HullObstacle& obstacle) {
  Hull hull;
  try {
    hull = ConvexHull(obstacle.points_in_world);
  } catch (const std::exception& error) {
    throw std::invalid_argument("obstacle hull '" + obstacle.name + "': " + error.what());
  }
  // Vertices about their own centre: distances are found more exactly near the origin.
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const auto& vertex : hull.vertices) centre += vertex / static_cast<double>(hull.vertices.size());
  for (auto& vertex : hull.vertices) vertex -= centre;
  auto faces = std::make_shared<std::vector<int>>();
  for (const auto& triangle : hull.triangles) faces->insert(faces->end(), {3, triangle[0], triangle[1], triangle[2]});
  const auto vertices = std::make_shared<const std::vector<Eigen::Vector3d>>(std::move(hull.vertices));
  const auto shape = std::make_shared<fcl::Convex<double>>(vertices, static_cast<int>(hull.triangles.size()), faces);
  return std::make_shared<Object>(shape, geometry::Rigid(Eigen::Translation3d(centre)));
}

}  // namespace

std::vector<std::shared_ptr<Object>> MakeCollisionObjects(const Obstacles& obstacles) {
  std::vector<std::shared_ptr<Object>> objects;
  for (const auto& box : obstacles.boxes) objects.push_back(MakeBox(box));
  for (const auto& hull : obstacles.hulls) objects.push_back(MakeHull(hull));
  return objects;
}

struct CollisionWorld::Impl {
  double radius_m = 0.0;
  std::vector<std::shared_ptr<Object>> objects;
  fcl::DynamicAABBTreeCollisionManager<double> manager;

  bool Touches(const std::shared_ptr<fcl::CollisionGeometry<double>>& shape, const geometry::Rigid& T_world_shape) const {
    Object body(shape, T_world_shape);
    fcl::DefaultCollisionData<double> data;
    manager.collide(&body, &data, fcl::DefaultCollisionFunction<double>);
    return data.result.isCollision();
  }
};

CollisionWorld::CollisionWorld(const Obstacles& obstacles, double radius_m) : impl_(std::make_unique<Impl>()) {
  if (!(radius_m > 0.0)) throw std::invalid_argument("radius_m must be > 0, is " + std::to_string(radius_m));
  impl_->radius_m = radius_m;
  impl_->objects = MakeCollisionObjects(obstacles);
  for (const auto& object : impl_->objects) impl_->manager.registerObject(object.get());
  impl_->manager.setup();
}

CollisionWorld::~CollisionWorld() = default;
CollisionWorld::CollisionWorld(CollisionWorld&&) noexcept = default;
CollisionWorld& CollisionWorld::operator=(CollisionWorld&&) noexcept = default;

bool CollisionWorld::IsFree(const Eigen::Vector3d& position_in_world) const {
  const auto sphere = std::make_shared<fcl::Sphere<double>>(impl_->radius_m);
  return !impl_->Touches(sphere, geometry::Rigid(Eigen::Translation3d(position_in_world)));
}

bool CollisionWorld::IsMoveFree(const Eigen::Vector3d& from_in_world, const Eigen::Vector3d& to_in_world) const {
  const Eigen::Vector3d move = to_in_world - from_in_world;
  const double length = move.norm();
  if (length < 1e-9) return IsFree(from_in_world);
  const auto capsule = std::make_shared<fcl::Capsule<double>>(impl_->radius_m, length);
  geometry::Rigid T_world_capsule = geometry::Rigid::Identity();
  T_world_capsule.translation() = (from_in_world + to_in_world) / 2.0;
  T_world_capsule.linear() = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), move).toRotationMatrix();
  return !impl_->Touches(capsule, T_world_capsule);
}

double CollisionWorld::Clearance(const Eigen::Vector3d& position_in_world) const {
  if (impl_->objects.empty()) return std::numeric_limits<double>::infinity();
  // From a tiny core in the body's middle: exact also where the body's skin touches, and GJK converges slowly on round shapes (0.6
  // mm off with a core of 1 mm).
  const double core_m = std::min(1e-5, impl_->radius_m / 2.0);
  Object core(std::make_shared<fcl::Sphere<double>>(core_m), geometry::Rigid(Eigen::Translation3d(position_in_world)));
  fcl::DefaultDistanceData<double> data;
  impl_->manager.distance(&core, &data, fcl::DefaultDistanceFunction<double>);
  return std::max(data.result.min_distance, 0.0) + core_m - impl_->radius_m;
}

}  // namespace vantage::motion
