// Does an arm touch obstacles or itself (FCL)? Internal to motion.
#pragma once

#include <memory>
#include <string>

#include "motion/arm_model.h"

namespace vantage::motion {

// Const and thread-safe. The base is fixed to the world: only the links that move are held against obstacles.
class ArmCollision {
 public:
  // Throws std::invalid_argument as CollisionWorld does.
  ArmCollision(std::shared_ptr<const ArmModel> arm, const Obstacles& obstacles);
  ~ArmCollision();

  // No link is nearer than params.clearance_m to an obstacle or to a link that is not its neighbour. Tens of microseconds.
  bool IsFree(const Eigen::VectorXd& joints_rad) const;

  // The straight move in joint space, its ends included, keeps at least kSureClearance_m from everything, all the way: by
  // bisection, a stretch is free where all links, grown by as much as any of their points travels in half of it, are free in its
  // middle.
  bool IsMoveFree(const Eigen::VectorXd& from_rad, const Eigen::VectorXd& to_rad) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

inline constexpr double kSureClearance_m = 0.008;

}  // namespace vantage::motion
