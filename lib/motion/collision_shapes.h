// Obstacles as FCL objects. Internal to motion.
#pragma once

#include <fcl/narrowphase/collision_object.h>

#include <memory>
#include <vector>

#include "motion/obstacles.h"

namespace vantage::motion {

// Throws std::invalid_argument naming the obstacle, as CollisionWorld says.
std::vector<std::shared_ptr<fcl::CollisionObject<double>>> MakeCollisionObjects(const Obstacles& obstacles);

}  // namespace vantage::motion
