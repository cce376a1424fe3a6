#include "recognition/voting.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace vantage::recognition {

Vote CastVote(const cv::KeyPoint& query, const cv::KeyPoint& model, const Eigen::Vector2d& centre_from_keypoint, double radius_px) {
  const double scale = model.size > 0.f ? query.size / model.size : 1.0;
  const double angle = (query.angle - model.angle) * M_PI / 180.0;
  const Eigen::Rotation2Dd rotation(angle);
  return {rotation * centre_from_keypoint * scale + Eigen::Vector2d(query.pt.x, query.pt.y), radius_px * scale, 1.0};
}

std::vector<VoteCluster> MeanShift(const std::vector<Vote>& votes, double bandwidth) {
  constexpr int kMaxSteps = 20;
  std::vector<double> reach_px2;  // Squared.
  for (const Vote& vote : votes) reach_px2.push_back(bandwidth * vote.radius_px * bandwidth * vote.radius_px);
  std::vector<Eigen::Vector2d> modes;
  // Most climbs come to a place where another was: the mean depends on which votes are in reach alone.
  std::map<std::pair<double, double>, Eigen::Vector2d> mean_about;
  const auto mean_of = [&](const Eigen::Vector2d& place) {
    const auto [known, is_new] = mean_about.try_emplace({place.x(), place.y()}, place);
    if (!is_new) return known->second;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double weight = 0.0;
    for (size_t i = 0; i < votes.size(); ++i) {
      const Vote& vote = votes[i];
      if ((vote.centre - place).squaredNorm() > reach_px2[i]) continue;
      sum += vote.weight * vote.centre;
      weight += vote.weight;
    }
    if (weight > 0.0) known->second = sum / weight;
    return known->second;
  };
  for (const Vote& start : votes) {
    Eigen::Vector2d mode = start.centre;
    for (int step = 0; step < kMaxSteps; ++step) {
      const Eigen::Vector2d next = mean_of(mode);
      const bool still = (next - mode).norm() < 0.05;
      mode = next;
      if (still) break;
    }
    modes.push_back(mode);
  }
  std::vector<VoteCluster> clusters;
  for (size_t i = 0; i < votes.size(); ++i) {
    const auto same = std::find_if(clusters.begin(), clusters.end(), [&](const VoteCluster& cluster) {
      return (cluster.centre - modes[i]).norm() < 0.5 * bandwidth * votes[i].radius_px;
    });
    VoteCluster& cluster = same != clusters.end() ? *same : clusters.emplace_back(VoteCluster{modes[i], 0.0, {}});
    cluster.weight += votes[i].weight;
    cluster.votes.push_back(static_cast<int>(i));
  }
  std::stable_sort(clusters.begin(), clusters.end(), [](const auto& a, const auto& b) { return a.weight > b.weight; });
  return clusters;
}

}  // namespace vantage::recognition
