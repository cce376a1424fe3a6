// How far off a structured-light depth is: one model for every refinement that weighs depth against pixels.
#pragma once

#include <stdexcept>

namespace vantage::pose {

// sigma_z = base_m + slope * z^2, metres.
struct DepthNoise {
  double base_m = 0.0015;  // > 0.
  double slope = 0.0025;   // Per metre; >= 0.

  double Sigma(double depth_m) const { return base_m + slope * depth_m * depth_m; }

  void Check() const {
    if (!(base_m > 0.0)) throw std::invalid_argument("depth_noise: base_m must be > 0");
    if (!(slope >= 0.0)) throw std::invalid_argument("depth_noise: slope must be >= 0");
  }
};

}  // namespace vantage::pose
