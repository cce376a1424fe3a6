#include "pose/cluster_search.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

#include "pose/p3p.h"
#include "pose/refine.h"

namespace vantage::pose {
namespace {

constexpr float kNone = std::numeric_limits<float>::infinity();

// 0 .. below - 1, the same everywhere.
int Uniform(std::mt19937* random, int below) { return static_cast<int>((static_cast<std::uint64_t>((*random)()) * below) >> 32); }

// FNV-1a over the matches: what a cluster draws follows from what it holds.
std::uint32_t HashOf(const std::vector<Match2d3d>& matches, std::uint32_t seed) {
  std::uint64_t hash = 14695981039346656037ull ^ seed;
  const auto add = [&hash](double value) {
    std::uint64_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    hash = (hash ^ bits) * 1099511628211ull;
    hash ^= hash >> 29;
  };
  for (const Match2d3d& match : matches) {
    add(match.pixel.x());
    add(match.pixel.y());
    for (int axis = 0; axis < 3; ++axis) add(match.point[axis]);
  }
  return static_cast<std::uint32_t>(hash ^ (hash >> 32));
}

}  // namespace

Scorer::Scorer(const std::vector<Match2d3d>& matches, const geometry::PinholeCamera& camera, double inlier_px, std::mt19937* random)
    : fx_(static_cast<float>(camera.fx)), fy_(static_cast<float>(camera.fy)), limit_(static_cast<float>(inlier_px * inlier_px)) {
  // In random order, so that any first part of them is a fair sample and bad poses are given up early.
  std::vector<int> order(matches.size());
  std::iota(order.begin(), order.end(), 0);
  for (size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[Uniform(random, static_cast<int>(i))]);
  blocks_.resize((matches.size() + kLanes - 1) / kLanes);
  // What fills up the last block is an outlier to every pose.
  for (Block& block : blocks_) {
    block.x.setZero();
    block.y.setZero();
    block.z.setZero();
    block.u.setConstant(1e6f);
    block.v.setConstant(1e6f);
  }
  for (size_t i = 0; i < order.size(); ++i) {
    const Match2d3d& match = matches[order[i]];
    Block& block = blocks_[i / kLanes];
    const int lane = static_cast<int>(i % kLanes);
    block.x[lane] = static_cast<float>(match.point.x());
    block.y[lane] = static_cast<float>(match.point.y());
    block.z[lane] = static_cast<float>(match.point.z());
    block.u[lane] = static_cast<float>(match.pixel.x() - camera.cx);
    block.v[lane] = static_cast<float>(match.pixel.y() - camera.cy);
  }
}

float Scorer::Cost(const geometry::Rigid& T_camera_object, float give_up) const {
  constexpr int kBlocksAtOnce = 4;
  Eigen::Matrix<float, 3, 4> P = T_camera_object.matrix().topRows<3>().cast<float>();
  P.row(0) *= fx_;
  P.row(1) *= fy_;
  float cost = 0.f;
  for (size_t begin = 0; begin < blocks_.size(); begin += kBlocksAtOnce) {
    const size_t end = std::min(begin + kBlocksAtOnce, blocks_.size());
    Lanes sum = Lanes::Zero();
    for (size_t i = begin; i < end; ++i) {
      const Block& b = blocks_[i];
      // Behind the camera the depth is as good as zero, and the error as good as infinite.
      const Lanes inverse_z = (P(2, 0) * b.x + P(2, 1) * b.y + P(2, 2) * b.z + P(2, 3)).max(1e-6f).inverse();
      const Lanes du = (P(0, 0) * b.x + P(0, 1) * b.y + P(0, 2) * b.z + P(0, 3)) * inverse_z - b.u;
      const Lanes dv = (P(1, 0) * b.x + P(1, 1) * b.y + P(1, 2) * b.z + P(1, 3)) * inverse_z - b.v;
      sum += (du * du + dv * dv).min(limit_);
    }
    cost += sum.sum();
    if (cost > give_up) break;
  }
  return cost;
}

ClusterSearch::ClusterSearch(const MatchCluster& cluster, const geometry::PinholeCamera& camera, const rgbd::Frame* depth,
                             const RansacParams& params, std::uint32_t seed)
    : cluster_(cluster),
      camera_(camera),
      params_(params),
      random_(HashOf(cluster.matches, seed)),
      scorer_(cluster.matches, camera, params.inlier_px, &random_),
      best_cost_(kNone),
      best_raw_cost_(kNone) {
  const size_t count = cluster.matches.size();
  rays_.resize(3, count);
  depths_.assign(count, std::nullopt);
  for (size_t i = 0; i < count; ++i) {
    rays_.col(i) = camera.Unproject(cluster.matches[i].pixel, 1.0).normalized();
    if (depth) depths_[i] = rgbd::DepthAt(*depth, cluster.matches[i].pixel);
  }
}

std::array<int, 3> ClusterSearch::Sample() {
  std::array<int, 3> sample;
  for (int k = 0; k < 3; ++k) {
    do {
      sample[k] = Uniform(&random_, static_cast<int>(cluster_.matches.size()));
    } while (std::find(sample.begin(), sample.begin() + k, sample[k]) != sample.begin() + k);
  }
  return sample;
}

bool ClusterSearch::Draw() {
  const std::array<int, 3> sample = Sample();
  ++best_.iterations;
  Eigen::Matrix3d rays, points;
  for (int k = 0; k < 3; ++k) {
    rays.col(k) = rays_.col(sample[k]);
    points.col(k) = cluster_.matches[sample[k]].point;
  }
  const P3pSolutions solutions = SolveP3p(rays, points);
  bool better = false;
  for (int s = 0; s < solutions.count; ++s) better |= Offer(solutions.T_camera_object[s], sample);
  return better;
}

// Whether the hypothesis, locally optimised, replaces the best pose.
bool ClusterSearch::Offer(const geometry::Rigid& T, const std::array<int, 3>& sample) {
  if (!DepthSupports(T, sample)) {
    ++best_.depth_rejected;
    return false;
  }
  // Hypotheses compete among themselves: a good one that was drawn from noisy matches is still optimised where some bad one's
  // optimum is better than it is itself.
  const float cost = scorer_.Cost(T, best_raw_cost_);
  if (cost >= best_raw_cost_) return false;
  const std::vector<int> inliers = Inliers(T);
  if (inliers.size() < 4) return false;
  if (!DepthSupports(T, inliers)) {
    ++best_.depth_rejected;
    return false;
  }
  best_raw_cost_ = cost;
  geometry::Rigid optimum = T;
  float optimum_cost = cost;
  geometry::Rigid refined = T;
  for (const double widening : {2.0, 1.5, 1.0}) {
    refined = Refined(refined, Within(refined, widening * params_.inlier_px));
    const float refined_cost = scorer_.Cost(refined, optimum_cost);
    if (refined_cost >= optimum_cost) continue;
    optimum = refined;
    optimum_cost = refined_cost;
  }
  if (optimum_cost >= best_cost_) return false;
  std::vector<int> explained = Inliers(optimum);
  if (!DepthSupports(optimum, explained)) {
    ++best_.depth_rejected;
    return false;
  }
  best_.T_camera_object = optimum;
  best_.inliers = std::move(explained);
  best_cost_ = optimum_cost;
  return true;
}

int ClusterSearch::IterationsNeeded() const {
  const double explained = std::max<double>(best_.inliers.size(), cluster_.min_inliers);
  return pose::IterationsNeeded(explained / cluster_.matches.size(), params_);
}

std::optional<PoseEstimate> ClusterSearch::Finish() const {
  if (best_.inliers.empty()) return std::nullopt;
  PoseEstimate result = best_;
  result.T_camera_object = Refined(best_.T_camera_object, best_.inliers);
  result.inliers = Inliers(result.T_camera_object);
  if (static_cast<int>(result.inliers.size()) < cluster_.min_inliers) return std::nullopt;
  if (!DepthSupports(result.T_camera_object, result.inliers)) return std::nullopt;
  return result;
}

std::vector<int> ClusterSearch::Within(const geometry::Rigid& T, double limit_px) const {
  std::vector<int> within;
  for (size_t i = 0; i < cluster_.matches.size(); ++i) {
    if (ReprojectionError(cluster_.matches[i], camera_, T) < limit_px) within.push_back(static_cast<int>(i));
  }
  return within;
}

// Whether the measured depth supports enough of these matches' points; |dz|, so that poses behind the surface fail too.
template <typename Index>
bool ClusterSearch::DepthSupports(const geometry::Rigid& T, const Index& index) const {
  int measured = 0, supported = 0;
  for (const int i : index) {
    if (!depths_[i]) continue;
    ++measured;
    supported += std::abs((T * cluster_.matches[i].point).z() - *depths_[i]) < params_.max_depth_error_m;
  }
  return measured == 0 || supported >= params_.min_depth_support * measured;
}

geometry::Rigid ClusterSearch::Refined(const geometry::Rigid& T, const std::vector<int>& index) const {
  return RefinePose(cluster_.matches, index, camera_, T, 0.5 * params_.inlier_px, 5);
}

int IterationsNeeded(double explained_share, const RansacParams& params) {
  const double all_good = explained_share * explained_share * explained_share;
  if (all_good >= 1.0 - 1e-12) return params.min_iterations;
  if (all_good <= 1e-12) return params.max_iterations;
  const double needed = std::log(params.failure_rate) / std::log1p(-all_good);
  return static_cast<int>(std::clamp(std::ceil(needed), double(params.min_iterations), double(params.max_iterations)));
}

}  // namespace vantage::pose
