// Strategies that know nothing of probabilities and costs, to compare the planner with.
#include <algorithm>
#include <cmath>
#include <random>

#include "exploration/shared_strategy.h"
#include "geometry/rigid.h"
#include "geometry/view_sphere.h"

namespace vantage::exploration {
namespace {

constexpr double kSweepStep_rad = 20.0 * M_PI / 180.0;
constexpr int kSweepSteps = 18;
constexpr int kSweepRings = 3;

class RandomStrategy : public SharedStrategy {
 public:
  using SharedStrategy::SharedStrategy;

 protected:
  void Choose(const Belief& /*belief*/, Decision& decision, const motion::Stance& stance,
              const motion::Mount& mount) const override {
    std::vector<Candidate*> urn = Untried(decision, mount);
    std::mt19937 generator(DecisionSeed());
    for (std::size_t left = urn.size(); left > 1; --left) std::swap(urn[generator() % left], urn[left - 1]);
    std::reverse(urn.begin(), urn.end());  // The first one drawn was put last.
    GoToFirst(urn, decision, stance, mount);
  }
};

class NearestStrategy : public SharedStrategy {
 public:
  using SharedStrategy::SharedStrategy;

 protected:
  void Choose(const Belief& /*belief*/, Decision& decision, const motion::Stance& stance,
              const motion::Mount& mount) const override {
    const std::vector<Candidate*> untried = Untried(decision, mount);
    PlanPaths(untried, stance, mount);
    const Candidate* nearest = nullptr;
    for (const Candidate* candidate : untried) {
      if (candidate->path && (nearest == nullptr || candidate->t_move_s < nearest->t_move_s)) nearest = candidate;
    }
    if (nearest == nullptr) {
      decision.stop = StopReason::kNothingReachable;
    } else {
      decision.chosen = static_cast<int>(nearest - decision.candidates.data());
    }
  }
};

// Rings about the object's own vertical axis as the candidates lie: the elevations are the middles of three equal parts of their
// range, the ring nearest to the first view comes first, the others after it upwards and then round again.
class SweepStrategy : public SharedStrategy {
 public:
  using SharedStrategy::SharedStrategy;

 protected:
  void Choose(const Belief& belief, Decision& decision, const motion::Stance& stance, const motion::Mount& mount) const override {
    std::vector<Candidate*> untried = Untried(decision, mount);
    const std::vector<Eigen::Vector3d> steps = Steps(belief, decision);
    std::vector<Candidate*> queue;
    for (std::size_t i = 0; i < steps.size() && !untried.empty(); ++i) {
      const Eigen::Vector3d& step = steps[(attempted().size() + i) % steps.size()];
      const auto nearest = std::max_element(untried.begin(), untried.end(), [&](const Candidate* a, const Candidate* b) {
        return a->view.viewpoint.direction.dot(step) < b->view.viewpoint.direction.dot(step);
      });
      queue.push_back(*nearest);
      untried.erase(nearest);
    }
    GoToFirst(queue, decision, stance, mount);
  }

 private:
  static std::vector<Eigen::Vector3d> Steps(const Belief& belief, const Decision& decision) {
    double lowest = M_PI_2, highest = -M_PI_2;
    for (const Candidate& candidate : decision.candidates) {
      const double elevation = geometry::Elevation(candidate.view.viewpoint.direction);
      lowest = std::min(lowest, elevation);
      highest = std::max(highest, elevation);
    }
    const Eigen::Vector3d first = belief.views.empty() ? Eigen::Vector3d::UnitX() : belief.views.front().direction;
    const double azimuth = geometry::Azimuth(first);
    const double ring_height = (highest - lowest) / kSweepRings;
    const int first_ring =
        std::clamp(static_cast<int>((geometry::Elevation(first) - lowest) / std::max(ring_height, 1e-9)), 0, kSweepRings - 1);
    std::vector<Eigen::Vector3d> steps;
    for (int k = 0; k < kSweepRings; ++k) {
      const int ring = (first_ring + k) % kSweepRings;
      const double elevation = lowest + (ring + 0.5) * ring_height;
      for (int i = 0; i < kSweepSteps; ++i) {
        const double a = azimuth + (i + (k == 0 ? 1 : 0)) * kSweepStep_rad;
        steps.emplace_back(std::cos(elevation) * std::cos(a), std::cos(elevation) * std::sin(a), std::sin(elevation));
      }
    }
    return steps;
  }
};

class CoverageStrategy : public SharedStrategy {
 public:
  using SharedStrategy::SharedStrategy;

 protected:
  void Choose(const Belief& belief, Decision& decision, const motion::Stance& stance, const motion::Mount& mount) const override {
    std::vector<std::pair<double, Candidate*>> queue;  // Unseen angle, less a full turn where detection is unlikely.
    for (Candidate* candidate : Untried(decision, mount)) {
      double unseen = M_PI;
      for (const auto* seen : {&belief.views, &attempted()}) {
        for (const measures::Viewpoint& view : *seen) {
          unseen = std::min(unseen, geometry::AngleBetween(view.direction, candidate->view.viewpoint.direction));
        }
      }
      const bool likely = candidate->detect_probability >= params_.min_detect_probability;
      queue.emplace_back(likely ? unseen : unseen - 2.0 * M_PI, candidate);
    }
    std::stable_sort(queue.begin(), queue.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
    std::vector<Candidate*> in_order;
    for (const auto& [unseen, candidate] : queue) in_order.push_back(candidate);
    GoToFirst(in_order, decision, stance, mount);
  }
};

}  // namespace

std::unique_ptr<Strategy> MakeBaseline(const std::string& name, const PlannerParams& params, std::uint32_t seed) {
  if (name == "random") return std::make_unique<RandomStrategy>(params, seed);
  if (name == "nearest") return std::make_unique<NearestStrategy>(params, seed);
  if (name == "sweep") return std::make_unique<SweepStrategy>(params, seed);
  if (name == "coverage") return std::make_unique<CoverageStrategy>(params, seed);
  return nullptr;
}

}  // namespace vantage::exploration
