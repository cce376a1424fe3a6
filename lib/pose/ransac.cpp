#include "pose/ransac.h"

#include <stdexcept>
#include <string>

#include "pose/multi_ransac.h"

namespace vantage::pose {

void RansacParams::Check() const {
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(std::string("ransac: ") + what);
  };
  require(inlier_px > 0.0, "inlier_px must be > 0");
  require(failure_rate > 0.0 && failure_rate < 1.0, "failure_rate must be in (0, 1)");
  require(min_iterations >= 1, "min_iterations must be >= 1");
  require(min_joint_iterations >= 1, "min_joint_iterations must be >= 1");
  require(max_iterations >= min_iterations, "max_iterations must be >= min_iterations");
  require(max_depth_error_m > 0.0, "max_depth_error_m must be > 0");
  require(min_depth_support >= 0.0 && min_depth_support <= 1.0, "min_depth_support must be in [0, 1]");
}

std::optional<PoseEstimate> EstimatePose(const std::vector<Match2d3d>& matches, const geometry::PinholeCamera& camera,
                                         const rgbd::Frame* depth, const RansacParams& params, std::uint32_t seed) {
  return EstimatePoses({MatchCluster{matches, {}, 4}}, camera, depth, params, seed).poses[0];
}

}  // namespace vantage::pose
