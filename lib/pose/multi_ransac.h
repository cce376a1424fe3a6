// Poses of many objects at once from clusters of 2D-3D matches (section IV-C).
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "pose/ransac.h"

namespace vantage::pose {

// Matches that may show one object in one place.
struct MatchCluster {
  std::vector<Match2d3d> matches;
  std::vector<int> keypoints;  // The image's interest point of every match (several may share one); empty = each its own, shared
                               // with no other cluster.
  int min_inliers = 4;         // Fewer explained matches are no pose; >= 4.
};

struct MultiPose {
  std::vector<std::optional<PoseEstimate>> poses;  // One per cluster, in the clusters' order.
  int iterations = 0;                              // Of the longest-running cluster.
  int matched = 0;                                 // Interest points with a match in a cluster that could reach its min_inliers...
  int explained = 0;                               // ...and those of them that some pose explains.
};

// Every iteration draws one P3P hypothesis for each cluster that still runs; a cluster keeps the better (MSAC; Torr and Zisserman,
// 2000), a new best is locally optimised (Chum, Matas and Kittler, 2003). All end when
//     eta = (1 - eps^n)^k <= eta_0,    n = 3, eps = explained / matched over the whole image,              (8)
// but not before params.min_joint_iterations, and a cluster alone when the same holds for its own eps, taken to be at least the
// share it needs to be accepted. Until the joint end may come each cluster is on its own, and all cores are used. Clusters that
// can never reach min_inliers are not drawn for. What a cluster draws depends on the seed and on its matches alone, so that the
// order of the clusters does not matter. `depth` may be null: no depth check.
//
// Throws std::invalid_argument where a cluster's keypoints are neither empty nor one per match, or its min_inliers is < 4. Cost:
// 1 to 2 us a cluster and iteration at 200 matches.
MultiPose EstimatePoses(const std::vector<MatchCluster>& clusters, const geometry::PinholeCamera& camera, const rgbd::Frame* depth,
                        const RansacParams& params, std::uint32_t seed);

}  // namespace vantage::pose
