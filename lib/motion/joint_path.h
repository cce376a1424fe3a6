// Times a polyline in joint space. Internal to motion.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace vantage::motion {

struct JointLimits {
  Eigen::VectorXd max_speed_rad_s, max_acceleration_rad_s2;  // Of every joint; > 0.
  Eigen::VectorXd reach_m;                                   // How far a joint's turn carries things: metres per radian.
};

struct TimedJoints {
  double time_s = 0.0;
  Eigen::VectorXd joints_rad;
};

// As TimePath, for joints: from rest to rest within the limits, as fast as they allow. Corners are rounded by so little that
// nothing leaves the polyline by more than corner_cut_m; with 0 the arm stops at each. Entries are at most 50 ms apart; one where
// nothing moves. Throws std::invalid_argument without joints.
std::vector<TimedJoints> TimeJointPath(const std::vector<Eigen::VectorXd>& polyline, const JointLimits& limits,
                                       double corner_cut_m);

}  // namespace vantage::motion
