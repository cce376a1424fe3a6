// Camera pose from three point correspondences.
#pragma once

#include <Eigen/Core>
#include <array>

#include "geometry/rigid.h"

namespace vantage::pose {

struct P3pSolutions {
  std::array<geometry::Rigid, 4> T_camera_object;
  int count = 0;
};

// All poses that put the three points (columns of `points_in_object`, metres) on the three rays (columns of `rays_in_camera`, unit,
// z > 0), by the quartic of Grunert (1841) as reviewed by Haralick et al. (1994), polished by Newton steps. 0 to 4 solutions,
// points in front of the camera; none where the points are collinear. Cost: about 1 us.
P3pSolutions SolveP3p(const Eigen::Matrix3d& rays_in_camera, const Eigen::Matrix3d& points_in_object);

// Real roots of x^4 + b x^3 + c x^2 + d x + e, unordered, multiple roots may repeat. Returns how many.
int SolveQuartic(double b, double c, double d, double e, std::array<double, 4>* roots);

}  // namespace vantage::pose
