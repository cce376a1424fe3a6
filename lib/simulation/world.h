// A world that a camera can move about in: simulated (Embree), or the recorded views of a real scene that can be visited.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "motion/obstacles.h"
#include "rgbd/frame.h"

namespace vantage::simulation {

// What is really there, for judging only.
struct TrueObject {
  std::string name;
  geometry::Rigid T_world_object = geometry::Rigid::Identity();  // Mesh coordinates to world.
  Eigen::Matrix3Xd points;                                       // 3 x N surface points, mesh coordinates, metres.
};

class World {
 public:
  virtual ~World() = default;

  // The frame a camera at that pose sees. A recorded world knows its own poses only: it shows the recorded frame nearest to it
  // (T_world_camera of the result says which). Deterministic in (pose, seed).
  virtual rgbd::Frame Look(const geometry::Rigid& T_world_camera, std::uint32_t seed) const = 0;

  // The poses that can be visited; empty = any.
  virtual std::vector<geometry::Rigid> Viewpoints() const = 0;

  virtual geometry::Rigid StartPose() const = 0;
  virtual geometry::PinholeCamera Camera() const = 0;
  // Fixed furniture known beforehand (walls, table top); objects come from the learner.
  virtual motion::Obstacles Furniture() const = 0;
  virtual std::vector<TrueObject> Truth() const = 0;
};

}  // namespace vantage::simulation
