#include "pose/ransac.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>
#include <string>

#include "pose/p3p.h"
#include "pose/refine.h"

namespace vantage::pose {
namespace {

// Truncated squared reprojection error, summed (MSAC): lower is better.
struct Score {
  double cost = 0.0;
  int inliers = 0;
};

class Problem {
 public:
  Problem(const std::vector<Match2d3d>& matches, const geometry::PinholeCamera& camera, const rgbd::Frame* depth,
          const RansacParams& params)
      : matches_(matches), camera_(camera), params_(params), squared_limit_(params.inlier_px * params.inlier_px) {
    rays_.resize(3, matches.size());
    depths_.assign(matches.size(), std::nullopt);
    for (size_t i = 0; i < matches.size(); ++i) {
      rays_.col(i) = camera.Unproject(matches[i].pixel, 1.0).normalized();
      if (depth) depths_[i] = rgbd::DepthAt(*depth, matches[i].pixel);
    }
  }

  int size() const { return static_cast<int>(matches_.size()); }

  P3pSolutions Solve(const std::array<int, 3>& sample) const {
    Eigen::Matrix3d rays, points;
    for (int k = 0; k < 3; ++k) {
      rays.col(k) = rays_.col(sample[k]);
      points.col(k) = matches_[sample[k]].point;
    }
    return SolveP3p(rays, points);
  }

  Score Evaluate(const geometry::Rigid& T, double give_up_cost) const {
    const Eigen::Matrix3d R = T.linear();
    const Eigen::Vector3d t = T.translation();
    Score score;
    for (const Match2d3d& match : matches_) {
      const Eigen::Vector3d p = R * match.point + t;
      double squared = squared_limit_;
      if (p.z() > 1e-3) {
        const double du = camera_.fx * p.x() / p.z() + camera_.cx - match.pixel.x();
        const double dv = camera_.fy * p.y() / p.z() + camera_.cy - match.pixel.y();
        squared = std::min(squared_limit_, du * du + dv * dv);
      }
      score.cost += squared;
      score.inliers += squared < squared_limit_;
      if (score.cost > give_up_cost) break;
    }
    return score;
  }

  std::vector<int> Inliers(const geometry::Rigid& T) const {
    std::vector<int> inliers;
    for (int i = 0; i < size(); ++i) {
      if (ReprojectionError(matches_[i], camera_, T) < params_.inlier_px) inliers.push_back(i);
    }
    return inliers;
  }

  // Whether the measured depth supports enough of these matches' points; |dz|, so that poses behind the surface fail too.
  template <typename Index>
  bool DepthSupports(const geometry::Rigid& T, const Index& index) const {
    int measured = 0, supported = 0;
    for (const int i : index) {
      if (!depths_[i]) continue;
      ++measured;
      supported += std::abs((T * matches_[i].point).z() - *depths_[i]) < params_.max_depth_error_m;
    }
    return measured == 0 || supported >= params_.min_depth_support * measured;
  }

  geometry::Rigid Refined(const geometry::Rigid& T, const std::vector<int>& inliers) const {
    return RefinePose(matches_, inliers, camera_, T, 0.5 * params_.inlier_px);
  }

 private:
  const std::vector<Match2d3d>& matches_;
  const geometry::PinholeCamera& camera_;
  const RansacParams& params_;
  const double squared_limit_;
  Eigen::Matrix3Xd rays_;
  std::vector<std::optional<double>> depths_;
};

std::array<int, 3> Sample(int size, std::mt19937* random) {
  std::array<int, 3> sample;
  for (int k = 0; k < 3; ++k) {
    do {
      sample[k] = static_cast<int>((static_cast<std::uint64_t>((*random)()) * size) >> 32);
    } while (std::find(sample.begin(), sample.begin() + k, sample[k]) != sample.begin() + k);
  }
  return sample;
}

// k of equation (8), n = 3.
int IterationsNeeded(double inlier_ratio, const RansacParams& params) {
  const double all_good = inlier_ratio * inlier_ratio * inlier_ratio;
  if (all_good >= 1.0 - 1e-12) return params.min_iterations;
  if (all_good <= 1e-12) return params.max_iterations;
  const double needed = std::log(params.failure_rate) / std::log1p(-all_good);
  return static_cast<int>(std::clamp(std::ceil(needed), double(params.min_iterations), double(params.max_iterations)));
}

}  // namespace

void RansacParams::Check() const {
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(std::string("ransac: ") + what);
  };
  require(inlier_px > 0.0, "inlier_px must be > 0");
  require(failure_rate > 0.0 && failure_rate < 1.0, "failure_rate must be in (0, 1)");
  require(min_iterations >= 1, "min_iterations must be >= 1");
  require(max_iterations >= min_iterations, "max_iterations must be >= min_iterations");
  require(max_depth_error_m > 0.0, "max_depth_error_m must be > 0");
  require(min_depth_support >= 0.0 && min_depth_support <= 1.0, "min_depth_support must be in [0, 1]");
}

std::optional<PoseEstimate> EstimatePose(const std::vector<Match2d3d>& matches, const geometry::PinholeCamera& camera,
                                         const rgbd::Frame* depth, const RansacParams& params, std::uint32_t seed) {
  if (matches.size() < 4) return std::nullopt;
  const Problem problem(matches, camera, depth, params);
  std::mt19937 random(seed);
  PoseEstimate best;
  double best_cost = std::numeric_limits<double>::infinity();
  int needed = params.max_iterations;
  for (best.iterations = 0; best.iterations < needed; ++best.iterations) {
    const std::array<int, 3> sample = Sample(problem.size(), &random);
    const P3pSolutions solutions = problem.Solve(sample);
    for (int s = 0; s < solutions.count; ++s) {
      const geometry::Rigid& T = solutions.T_camera_object[s];
      if (!problem.DepthSupports(T, sample)) {
        ++best.depth_rejected;
        continue;
      }
      const Score score = problem.Evaluate(T, best_cost);
      if (score.cost >= best_cost || score.inliers < 4) continue;
      // Local optimisation: a refined hypothesis lets the loop end sooner.
      const std::vector<int> inliers = problem.Inliers(T);
      if (!problem.DepthSupports(T, inliers)) {
        ++best.depth_rejected;
        continue;
      }
      const geometry::Rigid refined = problem.Refined(T, inliers);
      const Score refined_score = problem.Evaluate(refined, std::numeric_limits<double>::infinity());
      const bool better = refined_score.cost < score.cost;
      best.T_camera_object = better ? refined : T;
      best_cost = better ? refined_score.cost : score.cost;
      needed = IterationsNeeded(double(better ? refined_score.inliers : score.inliers) / problem.size(), params);
    }
  }
  if (best_cost == std::numeric_limits<double>::infinity()) return std::nullopt;
  best.T_camera_object = problem.Refined(best.T_camera_object, problem.Inliers(best.T_camera_object));
  best.inliers = problem.Inliers(best.T_camera_object);
  if (best.inliers.size() < 4 || !problem.DepthSupports(best.T_camera_object, best.inliers)) return std::nullopt;
  return best;
}

}  // namespace vantage::pose
