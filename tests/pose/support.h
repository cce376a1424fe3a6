// Poses and matches of which the truth is known.
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "pose/ransac.h"

namespace vantage::pose {

inline const geometry::PinholeCamera kCamera{640, 480, 525, 525, 319.5, 239.5};

class Truth {
 public:
  explicit Truth(std::uint32_t seed) : random_(seed) {}
  double Uniform(double low, double high) { return low + (high - low) * (random_() / 4294967296.0); }
  double Normal() { return std::sqrt(-2.0 * std::log(Uniform(1e-12, 1.0))) * std::cos(Uniform(0.0, 2.0 * M_PI)); }
  Eigen::Vector3d Point(double size) { return {Uniform(-size, size), Uniform(-size, size), Uniform(-size, size)}; }
  geometry::Rigid Pose() {
    geometry::Rigid T = geometry::Rigid::Identity();
    T.linear() = Eigen::Quaterniond(Normal(), Normal(), Normal(), Normal()).normalized().toRotationMatrix();
    T.translation() = Eigen::Vector3d(Uniform(-0.1, 0.1), Uniform(-0.1, 0.1), Uniform(0.5, 0.9));
    return T;
  }
  // `count` matches of which a share are right, with `noise_px`; the right ones first.
  std::vector<Match2d3d> Matches(const geometry::Rigid& T, int count, double inlier_share, double noise_px) {
    std::vector<Match2d3d> matches;
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector3d point = Point(0.1);
      Eigen::Vector2d pixel = *kCamera.Project(T * point) + noise_px * Eigen::Vector2d(Normal(), Normal());
      if (i >= inlier_share * count) pixel = {Uniform(0, 640), Uniform(0, 480)};
      matches.push_back({pixel, point});
    }
    return matches;
  }

 private:
  std::mt19937 random_;
};

}  // namespace vantage::pose
