#include "pose/multi_ransac.h"

#include <algorithm>
#include <memory>
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
  bool done = false;
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
  int needed = searches.empty() ? 0 : params.max_iterations;
  for (int k = 1; k <= needed; ++k) {
    bool better = false, all_done = true;
    for (Running& running : searches) {
      if (running.done) continue;
      better |= running.search->Draw();
      running.done = k >= running.search->IterationsNeeded();
      all_done &= running.done;
    }
    if (better) {
      result.explained = CountExplained(clusters, searches);
      needed = IterationsNeeded(double(result.explained) / result.matched, params);
    }
    result.iterations = k;
    if (all_done) break;
  }
  for (const Running& running : searches) result.poses[running.cluster] = running.search->Finish();
  result.explained = CountExplained(clusters, searches);
  return result;
}

}  // namespace vantage::pose
