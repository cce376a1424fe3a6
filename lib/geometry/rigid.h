// Rigid transforms. T_a_b maps points of frame b into frame a: x_a = T_a_b * x_b.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace vantage::geometry {

using Rigid = Eigen::Isometry3d;

// Angle of the rotation, radians in [0, pi].
double RotationAngle(const Eigen::Matrix3d& rotation);

// Angle between two directions (need not be unit), radians in [0, pi]; 0 where one is zero.
double AngleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b);

// How far apart two poses are: metres between the origins, radians between the axes.
struct PoseDifference {
  double translation_m = 0.0;
  double rotation_rad = 0.0;
};
PoseDifference Difference(const Rigid& a, const Rigid& b);

// The pose of a camera (x right, y down, z forward) at `eye` that looks at `target` with the image's up towards `up`, then turned
// by `roll_rad` about the optical axis. Where the line of sight is parallel to `up`, some other up is taken. Throws
// std::invalid_argument where eye == target.
Rigid LookAt(const Eigen::Vector3d& eye, const Eigen::Vector3d& target, const Eigen::Vector3d& up, double roll_rad = 0.0);

// The pose a fraction t in [0, 1] of the way: straight line and shortest turn (slerp).
Rigid Interpolate(const Rigid& a, const Rigid& b, double t);

// Unit direction from the object's origin to the camera, in object coordinates: "from where the object is seen".
Eigen::Vector3d ViewDirection(const Rigid& T_camera_object);

}  // namespace vantage::geometry
