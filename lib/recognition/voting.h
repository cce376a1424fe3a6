// Votes of tentative matches for the object's centre in the image, and their grouping (section IV-B).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <vector>

namespace vantage::recognition {

struct Vote {
  Eigen::Vector2d centre;  // Where the match says the object's centre is, pixels.
  double radius_px = 1.0;  // How large it says the object is.
  double weight = 1.0;     // >= 0.
};

// Equation (7): x_v = R x_d s_rel + x_q. `centre_from_keypoint` is x_d: from the model interest point to the object's centre in the
// learned view; scale and rotation are those of the query relative to the model interest point.
Vote CastVote(const cv::KeyPoint& query, const cv::KeyPoint& model, const Eigen::Vector2d& centre_from_keypoint, double radius_px);

struct VoteCluster {
  Eigen::Vector2d centre;
  double weight = 0.0;
  std::vector<int> votes;  // Indices, ascending.
};

// Mean shift with a flat kernel whose width is `bandwidth` times each vote's own radius. Clusters by falling weight; every vote is
// in the cluster of the mode it climbs to. Deterministic. Cost: quadratic in the votes.
std::vector<VoteCluster> MeanShift(const std::vector<Vote>& votes, double bandwidth);

}  // namespace vantage::recognition
