// Poses, cameras and directions on the wire. What comes from the wire is checked; errors are values.
#pragma once

#include <vantage/camera_t.hpp>
#include <vantage/pose_t.hpp>

#include "geometry/camera.h"
#include "geometry/rigid.h"
#include "messaging/result.h"

namespace vantage::messaging {

pose_t ToMessage(const geometry::Rigid& T_a_b);
// Refuses values that are not finite, positions beyond 1 km and quaternions that are not of unit length (within 1 %).
Result<geometry::Rigid> FromMessage(const pose_t& message);

camera_t ToMessage(const geometry::PinholeCamera& camera);
// Refuses sizes outside 1..8192 pixels and intrinsics that are not finite or not positive.
Result<geometry::PinholeCamera> FromMessage(const camera_t& message);

// Whether every one of the `count` values is finite.
bool AllFinite(const double* values, int count);
// In [0, 1]; false for NaN.
bool IsProbability(double value);

}  // namespace vantage::messaging
