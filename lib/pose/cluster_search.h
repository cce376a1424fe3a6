// The search for one cluster's pose: draws hypotheses and keeps the best. Internal to pose.
#pragma once

#include <array>
#include <optional>
#include <random>
#include <vector>

#include "pose/multi_ransac.h"

namespace vantage::pose {

// Reprojection errors of many matches at once, in single precision.
class Scorer {
 public:
  Scorer(const std::vector<Match2d3d>& matches, const geometry::PinholeCamera& camera, double inlier_px, std::mt19937* random);

  // Squared errors truncated at the inlier limit, summed; lower is better. Gives up where it passes `give_up`.
  float Cost(const geometry::Rigid& T_camera_object, float give_up) const;

 private:
  static constexpr int kLanes = 8;
  using Lanes = Eigen::Array<float, kLanes, 1>;
  struct Block {
    Lanes x, y, z, u, v;  // Points; pixels relative to the principal point.
  };
  std::vector<Block, Eigen::aligned_allocator<Block>> blocks_;
  float fx_, fy_, limit_;
};

class ClusterSearch {
 public:
  // The arguments must outlive it.
  ClusterSearch(const MatchCluster& cluster, const geometry::PinholeCamera& camera, const rgbd::Frame* depth,
                const RansacParams& params, std::uint32_t seed);

  // One P3P hypothesis. Returns whether the best pose changed.
  bool Draw();

  // k of equation (8) for this cluster alone.
  int IterationsNeeded() const;
  // The matches the best pose explains; empty without one.
  const std::vector<int>& explained() const { return best_.inliers; }
  // The best pose, refined; nullopt where it explains too little.
  std::optional<PoseEstimate> Finish() const;

 private:
  std::array<int, 3> Sample();
  bool Offer(const geometry::Rigid& T_camera_object, const std::array<int, 3>& sample);
  std::vector<int> Within(const geometry::Rigid& T_camera_object, double limit_px) const;
  std::vector<int> Inliers(const geometry::Rigid& T_camera_object) const { return Within(T_camera_object, params_.inlier_px); }
  template <typename Index>
  bool DepthSupports(const geometry::Rigid& T_camera_object, const Index& index) const;
  geometry::Rigid Refined(const geometry::Rigid& T_camera_object, const std::vector<int>& index) const;

  const MatchCluster& cluster_;
  const geometry::PinholeCamera& camera_;
  const RansacParams& params_;
  std::mt19937 random_;
  Scorer scorer_;
  Eigen::Matrix3Xd rays_;
  std::vector<std::optional<double>> depths_;
  PoseEstimate best_;
  float best_cost_;      // Of best_.
  float best_raw_cost_;  // Of the best hypothesis before local optimisation.
};

// k of equation (8) for a share of explained matches, between the params' limits.
int IterationsNeeded(double explained_share, const RansacParams& params);

}  // namespace vantage::pose
