#include "pose/multi_ransac.h"

#include <algorithm>
#include <memory>
#include <opencv2/core/utility.hpp>
#include <stdexcept>
#include <string>

#include "pose/cluster_search.h"

namespace vantage::pose {
namespace {

void CheckCluster(const MatchCluster& cluster, size_t number) {
  const std::string who = "match cluster " + std::to_string(number) + ": ";
  if (!cluster.keypoints.empty() && cluster.keypoints.size() != cluster.matches.size()) {
    throw std::invalid_argument(who + "keypoints must be empty or one per match, is " + std::to_string(cluster.keypoints.size()) +
                                " for " + std::to_string(cluster.matches.size()));
  }
  if (cluster.min_inliers < 4) {
    throw std::invalid_argument(who + "min_inliers must be >= 4, is " + std::to_string(cluster.min_inliers));
  }
}

// Counts distinct interest points: those named by the clusters, and one for each match of a cluster that names none.
class PointCounter {
 public:
  void Add(int keypoint) { named_.push_back(keypoint); }
  void AddUnnamed() { ++unnamed_; }
  int Count() {
    std::sort(named_.begin(), named_.end());
    named_.erase(std::unique(named_.begin(), named_.end()), named_.end());
    return static_cast<int>(named_.size()) + unnamed_;
  }

 private:
  std::vector<int> named_;
  int unnamed_ = 0;
};

struct Running {
  size_t cluster;
  std::unique_ptr<ClusterSearch> search;
  int drawn = 0;
  bool done = false;

  // Returns whether the best pose changed.
  bool Draw() {
    const bool better = search->Draw();
    done = ++drawn >= search->IterationsNeeded();
    return better;
  }
};

int CountMatched(const std::vector<MatchCluster>& clusters, const std::vector<Running>& searches) {
  PointCounter matched;
  for (const Running& running : searches) {
    const MatchCluster& cluster = clusters[running.cluster];
    for (size_t i = 0; i < cluster.matches.size(); ++i) {
      cluster.keypoints.empty() ? matched.AddUnnamed() : matched.Add(cluster.keypoints[i]);
    }
  }
  return matched.Count();
}

int CountExplained(const std::vector<MatchCluster>& clusters, const std::vector<Running>& searches) {
  PointCounter explained;
  for (const Running& running : searches) {
    const MatchCluster& cluster = clusters[running.cluster];
    const std::vector<int>& inliers = running.search->explained();
    if (static_cast<int>(inliers.size()) < cluster.min_inliers) continue;
    for (const int i : inliers) cluster.keypoints.empty() ? explained.AddUnnamed() : explained.Add(cluster.keypoints[i]);
  }
  return explained.Count();
}

}  // namespace

MultiPose EstimatePoses(const std::vector<MatchCluster>& clusters, const geometry::PinholeCamera& camera, const rgbd::Frame* depth,
                        const RansacParams& params, std::uint32_t seed) {
  MultiPose result;
  result.poses.resize(clusters.size());
  std::vector<Running> searches;
  for (size_t i = 0; i < clusters.size(); ++i) {
    CheckCluster(clusters[i], i);
    if (static_cast<int>(clusters[i].matches.size()) < clusters[i].min_inliers) continue;
    searches.push_back({i, std::make_unique<ClusterSearch>(clusters[i], camera, depth, params, seed)});
  }
  result.matched = CountMatched(clusters, searches);
  // No joint end before the last of these.
  const int alone = std::min(params.min_joint_iterations, params.max_iterations);
  cv::parallel_for_(cv::Range(0, static_cast<int>(searches.size())), [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i) {
      while (!searches[i].done && searches[i].drawn < alone) searches[i].Draw();
    }
  });
  bool better = true;
  int needed = 0;
  for (int k = alone; !searches.empty(); ++k) {
    if (better) {
      result.explained = CountExplained(clusters, searches);
      needed = IterationsNeeded(double(result.explained) / result.matched, params);
    }
    if (k >= needed) break;
    bool all_done = true;
    better = false;
    for (Running& running : searches) {
      if (running.done) continue;
      better |= running.Draw();
      all_done = false;
    }
    if (all_done) break;
  }
  for (const Running& running : searches) {
    result.iterations = std::max(result.iterations, running.drawn);
    result.poses[running.cluster] = running.search->Finish();
  }
  result.explained = CountExplained(clusters, searches);
  return result;
}

}  // namespace vantage::pose
