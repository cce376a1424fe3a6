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
  // Climbs that come to the very same place go on as one, and most do: the mean depends on which votes are in reach alone.
  std::map<std::pair<double, double>, Eigen::Vector2d> top_from;
  std::vector<std::pair<double, double>> passed;
  for (const Vote& start : votes) {
    Eigen::Vector2d mode = start.centre;
    passed.clear();
    for (int step = 0; step < kMaxSteps; ++step) {
      Eigen::Vector2d sum = Eigen::Vector2d::Zero();
      double weight = 0.0;
      for (size_t i = 0; i < votes.size(); ++i) {
        const Vote& vote = votes[i];
        if ((vote.centre - mode).squaredNorm() > reach_px2[i]) continue;
        sum += vote.weight * vote.centre;
        weight += vote.weight;
      }
      if (weight <= 0.0) break;
      const Eigen::Vector2d next = sum / weight;
      const bool still = (next - mode).norm() < 0.05;
      mode = next;
      if (still) break;
      if (const auto known = top_from.find({mode.x(), mode.y()}); known != top_from.end()) {
        mode = known->second;
        break;
      }
      passed.emplace_back(mode.x(), mode.y());
    }
    for (const auto& place : passed) top_from.emplace(place, mode);
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
