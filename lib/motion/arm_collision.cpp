#include "motion/arm_collision.h"

#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/cylinder.h>
#include <fcl/geometry/shape/sphere.h>
#include <fcl/narrowphase/collision.h>

#include "motion/collision_shapes.h"

namespace vantage::motion {
namespace {

constexpr double kLongestStretch_m = 0.5;  // Of half a stretch: growing more never pays.

template <typename Visitor>
bool WithShape(const ArmShape& shape, double grown_m, const Visitor& visit) {
  switch (shape.kind) {
    case ArmShape::Kind::kBox:
      return visit(fcl::Box<double>(Eigen::Vector3d(shape.size_m.array() + 2.0 * grown_m)));
    case ArmShape::Kind::kCylinder:
      return visit(fcl::Cylinder<double>(shape.size_m[0] + grown_m, shape.size_m[1] + 2.0 * grown_m));
    case ArmShape::Kind::kSphere:
      break;
  }
  return visit(fcl::Sphere<double>(shape.size_m[0] + grown_m));
}

bool Touch(const fcl::CollisionGeometry<double>& a, const geometry::Rigid& T_world_a, const fcl::CollisionGeometry<double>& b,
           const geometry::Rigid& T_world_b) {
  const fcl::CollisionRequest<double> request;
  fcl::CollisionResult<double> result;
  return fcl::collide(&a, T_world_a, &b, T_world_b, request, result) > 0;
}

}  // namespace

struct ArmCollision::Impl {
  std::shared_ptr<const ArmModel> arm;
  std::vector<std::shared_ptr<fcl::CollisionObject<double>>> obstacles;

  // No obstacle is within `grown_m` of a moving link.
  bool ObstaclesFree(const std::vector<geometry::Rigid>& T_world_links, double grown_m) const {
    for (std::size_t k = T_world_links.size(); k-- > 1;) {  // From the camera, which meets most.
      for (const ArmShape& shape : arm->links[k].shapes) {
        const geometry::Rigid T_world_shape = T_world_links[k] * shape.T_link_shape;
        const double ball_m = shape.RadiusAboutItsMiddle() + grown_m;
        for (const auto& obstacle : obstacles) {
          const auto& bounds = obstacle->getAABB();
          const Eigen::Vector3d middle = T_world_shape.translation();
          const Eigen::Vector3d off = (bounds.min_ - middle).cwiseMax(middle - bounds.max_).cwiseMax(0.0);
          if (off.norm() > ball_m) continue;
          const bool touches = WithShape(shape, grown_m, [&](const auto& geometry) {
            return Touch(geometry, T_world_shape, *obstacle->collisionGeometry(), obstacle->getTransform());
          });
          if (touches) return false;
        }
      }
    }
    return true;
  }

  bool PairFree(const std::vector<geometry::Rigid>& T_world_links, std::size_t i, std::size_t k, double grown_m) const {
    for (const ArmShape& a : arm->links[i].shapes) {
      const geometry::Rigid T_world_a = T_world_links[i] * a.T_link_shape;
      for (const ArmShape& b : arm->links[k].shapes) {
        const geometry::Rigid T_world_b = T_world_links[k] * b.T_link_shape;
        const double apart_m = (T_world_a.translation() - T_world_b.translation()).norm();
        if (apart_m > a.RadiusAboutItsMiddle() + b.RadiusAboutItsMiddle() + grown_m) continue;
        const bool touches = WithShape(a, grown_m, [&](const auto& first) {
          return WithShape(b, 0.0, [&](const auto& second) { return Touch(first, T_world_a, second, T_world_b); });
        });
        if (touches) return false;
      }
    }
    return true;
  }

  // Every pair of links that are not neighbours.
  template <typename Visitor>
  bool AllPairs(const Visitor& free) const {
    for (std::size_t i = 0; i < arm->links.size(); ++i) {
      for (std::size_t k = i + 2; k < arm->links.size(); ++k) {
        if (!free(i, k)) return false;
      }
    }
    return true;
  }

  // How far a point of link k travels, at most, as seen from link i, while the joints turn by these angles.
  double Travel(const Eigen::VectorXd& turns_rad, std::size_t i, std::size_t k) const {
    double travel_m = 0.0;
    for (std::size_t j = i; j < k; ++j) {
      travel_m += std::abs(turns_rad[static_cast<Eigen::Index>(j)]) *
                  arm->reach_m(static_cast<Eigen::Index>(j), static_cast<Eigen::Index>(k));
    }
    return travel_m;
  }

  // Whether a stretch of the move, given by its share, is free: free(links, grown_m) says so of one posture.
  template <typename Free>
  bool StretchFree(const Eigen::VectorXd& from, const Eigen::VectorXd& turn, double begin, double end, double travel_m,
                   const Free& free) const {
    const double half_m = 0.5 * (end - begin) * travel_m;
    const double middle = 0.5 * (begin + end);
    const double clearance_m = arm->params.clearance_m;
    if (half_m <= kLongestStretch_m) {
      const auto links = arm->LinkPoses(from + middle * turn);
      if (half_m <= clearance_m - kSureClearance_m) return free(links, clearance_m);
      if (free(links, half_m + kSureClearance_m)) return true;
      if (!free(links, clearance_m)) return false;
    }
    return StretchFree(from, turn, begin, middle, travel_m, free) && StretchFree(from, turn, middle, end, travel_m, free);
  }
};

ArmCollision::ArmCollision(std::shared_ptr<const ArmModel> arm, const Obstacles& obstacles) : impl_(std::make_unique<Impl>()) {
  impl_->arm = std::move(arm);
  impl_->obstacles = MakeCollisionObjects(obstacles);
}

ArmCollision::~ArmCollision() = default;

bool ArmCollision::IsFree(const Eigen::VectorXd& joints_rad) const {
  const auto links = impl_->arm->LinkPoses(joints_rad);
  const double clearance_m = impl_->arm->params.clearance_m;
  return impl_->ObstaclesFree(links, clearance_m) &&
         impl_->AllPairs([&](std::size_t i, std::size_t k) { return impl_->PairFree(links, i, k, clearance_m); });
}

bool ArmCollision::IsMoveFree(const Eigen::VectorXd& from_rad, const Eigen::VectorXd& to_rad) const {
  if (!IsFree(to_rad)) return false;
  const Eigen::VectorXd turn = to_rad - from_rad;
  const std::size_t last = impl_->arm->links.size() - 1;
  double travel_m = 0.0;
  for (std::size_t k = 1; k <= last; ++k) travel_m = std::max(travel_m, impl_->Travel(turn, 0, k));
  const bool clear = impl_->StretchFree(from_rad, turn, 0.0, 1.0, travel_m,
                                        [this](const auto& links, double grown_m) { return impl_->ObstaclesFree(links, grown_m); });
  return clear && impl_->AllPairs([&](std::size_t i, std::size_t k) {
    return impl_->StretchFree(from_rad, turn, 0.0, 1.0, impl_->Travel(turn, i, k),
                              [&](const auto& links, double grown_m) { return impl_->PairFree(links, i, k, grown_m); });
  });
}

}  // namespace vantage::motion
