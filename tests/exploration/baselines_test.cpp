// What the strategies that the planner is compared with choose, and why.
#include <gtest/gtest.h>

#include <set>

#include "exploration/support.h"
#include "geometry/rigid.h"
#include "geometry/view_sphere.h"

namespace vantage::exploration {
namespace {

// Views chosen one after the other; each is learned.
std::vector<CandidateView> Visited(Strategy& strategy, Belief belief, const std::vector<CandidateView>& views, int steps) {
  const TestMount mount;
  std::vector<CandidateView> visited;
  geometry::Rigid pose = views[0].T_world_camera;
  for (int i = 0; i < steps; ++i) {
    const Decision decision = strategy.Decide(belief, views, pose, mount, 0.0);
    if (decision.chosen < 0) break;
    visited.push_back(decision.candidates[static_cast<std::size_t>(decision.chosen)].view);
    pose = visited.back().T_world_camera;
    belief.views.push_back(visited.back().viewpoint);
    strategy.Report({visited.back().viewpoint, true, true, false, 0.5, 1.0});
  }
  return visited;
}

TEST(Nearest, GoesToTheNextOneEachTime) {
  const auto ring = Ring(10.0);
  const auto strategy = MakeStrategy("nearest", {}, 0);
  const auto visited = Visited(*strategy, BeliefFrom({ring[0]}, ring), ring, 4);
  ASSERT_EQ(visited.size(), 4u);
  EXPECT_EQ(visited[0].id, 0) << "where it is already costs no way";
  for (std::size_t i = 1; i < visited.size(); ++i) {
    EXPECT_NEAR(geometry::AngleBetween(visited[i].viewpoint.direction, visited[i - 1].viewpoint.direction), 10.0 * kDegree, 1e-9);
  }
}

TEST(Sweep, GoesRoundInSteps) {
  const auto ring = Ring(10.0);
  const auto strategy = MakeStrategy("sweep", {}, 0);
  const auto visited = Visited(*strategy, BeliefFrom({ring[0]}, ring), ring, 17);
  ASSERT_EQ(visited.size(), 17u);
  for (std::size_t i = 0; i < visited.size(); ++i) EXPECT_EQ(visited[i].id, static_cast<int>(2 * (i + 1)));
}

TEST(Sweep, TakesThreeElevations) {
  std::vector<CandidateView> dome;
  for (int elevation = 10; elevation <= 70; elevation += 10) {
    for (int azimuth = 0; azimuth < 360; azimuth += 10) {
      dome.push_back(ViewFrom(static_cast<int>(dome.size()), azimuth, elevation));
    }
  }
  PlannerParams params;
  params.target_completeness = 1.0;
  const auto strategy = MakeStrategy("sweep", params, 0);
  const auto visited = Visited(*strategy, BeliefFrom({dome[0]}, dome), dome, 54);
  ASSERT_EQ(visited.size(), 54u);
  std::set<int> elevations_deg;
  for (const CandidateView& view : visited) {
    elevations_deg.insert(static_cast<int>(std::lround(geometry::Elevation(view.viewpoint.direction) / kDegree)));
  }
  EXPECT_EQ(elevations_deg, (std::set<int>{20, 40, 60}));
}

TEST(Coverage, TakesTheLargestUnseenAngleThatCanBeLearned) {
  const auto ring = Ring(5.0);
  const auto strategy = MakeStrategy("coverage", {}, 0);
  const Belief belief = BeliefFrom({ring[0]}, ring);
  const Decision decision = strategy->Decide(belief, ring, ring[0].T_world_camera, TestMount(), 0.0);
  ASSERT_GE(decision.chosen, 0);
  const Candidate& chosen = decision.candidates[static_cast<std::size_t>(decision.chosen)];
  EXPECT_GE(chosen.detect_probability, PlannerParams().min_detect_probability);
  const double unseen = geometry::AngleBetween(chosen.view.viewpoint.direction, ring[0].viewpoint.direction);
  for (const Candidate& other : decision.candidates) {
    if (other.detect_probability < PlannerParams().min_detect_probability) continue;
    EXPECT_LE(geometry::AngleBetween(other.view.viewpoint.direction, ring[0].viewpoint.direction), unseen + 1e-9);
  }
}

TEST(Coverage, DoesNotGoWhereItWas) {
  const auto ring = Ring(20.0);
  const auto strategy = MakeStrategy("coverage", {}, 0);
  std::set<int> ids;
  const Belief belief = BeliefFrom({ring[0]}, ring);  // Nothing is ever learned.
  for (int i = 0; i < 10; ++i) {
    const Decision decision = strategy->Decide(belief, ring, ring[0].T_world_camera, TestMount(), 0.0);
    ASSERT_GE(decision.chosen, 0);
    const Candidate& chosen = decision.candidates[static_cast<std::size_t>(decision.chosen)];
    EXPECT_TRUE(ids.insert(chosen.view.id).second);
    strategy->Report({chosen.view.viewpoint, false, false, false, 0.5, 1.0});
  }
}

// Learned from view i, the object is seen from up to `reach` views further round; but view 3 is worthless.
OutcomeTable RingTable(const std::vector<CandidateView>& ring, int reach) {
  OutcomeTable table;
  const int count = static_cast<int>(ring.size());
  for (const CandidateView& view : ring) table.viewpoints.push_back(view.viewpoint);
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < count; ++j) {
      const int apart = std::min((i - j + count) % count, (j - i + count) % count);
      table.detected.push_back(static_cast<char>(i == 3 ? 0 : apart <= reach));
    }
  }
  return table;
}

TEST(Oracle, ChoosesByWhatIsTrueAndNotByWhatIsBelieved) {
  const auto ring = Ring(10.0);
  const Belief belief = BeliefFrom({ring[0]}, ring);
  const OutcomeTable table = RingTable(ring, 3);
  const auto strategy = MakeStrategy("oracle", {}, 0, &table);
  const Decision decision = strategy->Decide(belief, ring, ring[0].T_world_camera, TestMount(), 0.0);
  ASSERT_GE(decision.chosen, 0);
  EXPECT_EQ(decision.candidates[static_cast<std::size_t>(decision.chosen)].view.id, 33) << "3 the other way round gains nothing";
  EXPECT_EQ(decision.candidates[3].refusal, "no gain");
  EXPECT_EQ(decision.candidates[4].refusal, "too unlikely to detect");
  EXPECT_NEAR(decision.candidates[33].gain, 3.0 / 36.0, 1e-9);
}

TEST(Oracle, NeedsOutcomes) {
  EXPECT_THROW(MakeStrategy("oracle", {}, 0), std::invalid_argument);
  OutcomeTable broken = RingTable(Ring(10.0), 3);
  broken.detected.pop_back();
  EXPECT_THROW(MakeStrategy("oracle", {}, 0, &broken), std::invalid_argument);
}

}  // namespace
}  // namespace vantage::exploration
