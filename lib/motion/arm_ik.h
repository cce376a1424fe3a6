// Inverse kinematics of a serial arm (KDL). Internal to motion.
#pragma once

#include <memory>
#include <vector>

#include "motion/arm_model.h"

namespace vantage::motion {

class ArmIk {
 public:
  explicit ArmIk(std::shared_ptr<const ArmModel> arm);
  ~ArmIk();

  // Joints that put the camera at the goal's place (to 0.1 mm) and point it the same way (to 0.2 mrad), turned about its optical
  // axis as it comes: what is asked for is what is seen. By damped least squares from the postures that do nearly that already;
  // different from each other by at least 0.3 rad in some joint, nearest posture first. Empty where there is none. About 0.1 ms a
  // start.
  std::vector<Eigen::VectorXd> Solve(const geometry::Rigid& T_world_camera) const;
  // The one reached from here.
  std::optional<Eigen::VectorXd> SolveFrom(const geometry::Rigid& T_world_camera, const Eigen::VectorXd& start_rad) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vantage::motion
