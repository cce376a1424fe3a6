#include "exploration/planner.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "geometry/view_sphere.h"
#include "support.h"

namespace vantage::exploration {
namespace {

const Candidate& Chosen(const Decision& decision) { return decision.candidates.at(static_cast<std::size_t>(decision.chosen)); }

double AngleFrom(const Candidate& candidate, double azimuth_deg) {
  return geometry::AngleBetween(candidate.view.viewpoint.direction, Direction(azimuth_deg)) / kDegree;
}

// Attempts succeed as often as the measures say.
PlannerParams AsMeasured() {
  PlannerParams params;
  params.attempt_log_odds = 0.0;
  params.min_view_angle_rad = 0.0;
  return params;
}

TEST(Planner, LearnsAtTheFringeOfWhatIsKnown) {
  const auto ring = Ring(5.0);
  PlannerParams params;
  params.choose_by_rate = false;
  const Decision decision =
      MakeStrategy("planner", params, 0)->Decide(BeliefFrom({ring[0]}, ring), ring, ring[0].T_world_camera, TestMount(), 0.0);
  ASSERT_GE(decision.chosen, 0);
  EXPECT_EQ(decision.stop, StopReason::kNone);
  // Certain to be detected within 10 degrees, but nothing to learn; hopeless from 45 on.
  EXPECT_GT(AngleFrom(Chosen(decision), 0.0), 14.0);
  EXPECT_LT(AngleFrom(Chosen(decision), 0.0), 40.0);
  for (const Candidate& candidate : decision.candidates) EXPECT_LE(candidate.utility_s, Chosen(decision).utility_s);
  EXPECT_EQ(decision.candidates[1].refusal, "too near to a learned view");
  EXPECT_EQ(decision.candidates[36].refusal, "too unlikely to detect");
}

// Every candidate's numbers are its own, whatever was skipped before it; and they are the measures' own.
TEST(Planner, EveryCandidateCarriesItsOwnReasons) {
  const auto ring = Ring(7.0);
  TestMount mount;
  mount.unreachable = [](const geometry::Rigid& pose) { return pose.translation().y() > 0.25 ? "in collision" : ""; };
  mount.no_path = [](const geometry::Rigid& pose) { return pose.translation().y() > 0.2 ? "no path found" : ""; };
  for (const auto rule : measures::kCompletenessRules) {
    SCOPED_TRACE(ToString(rule));
    PlannerParams params = AsMeasured();
    params.worth_s = 600.0;
    params.rule = rule;
    params.max_path_goals = 3;
    Belief belief = BeliefFrom({ring[0], ring[5], ring[30]}, ring);
    belief.predicted.set_common_cause(0.4);  // No two rules are the same.
    for (std::size_t i = 0; i < belief.reachable.size(); ++i) belief.reachable[i].weight = static_cast<double>(i % 4);
    const Decision decision = MakeStrategy("planner", params, 0)->Decide(belief, ring, ring[2].T_world_camera, mount, 0.0);
    ASSERT_EQ(decision.candidates.size(), ring.size());
    EXPECT_NEAR(decision.completeness, Completeness(belief.views, belief.reachable, belief.predicted, rule), 1e-12);
    std::multiset<std::string> refusals;
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const Candidate& candidate = decision.candidates[i];
      EXPECT_EQ(candidate.view.id, ring[i].id);
      EXPECT_NEAR(candidate.detect_probability, DetectionProbability(belief.views, ring[i].viewpoint, belief.predicted, rule),
                  1e-12);
      auto views = belief.views;
      views.push_back(ring[i].viewpoint);
      EXPECT_NEAR(candidate.gain, Completeness(views, belief.reachable, belief.predicted, rule) - decision.completeness, 1e-9);
      EXPECT_NE(candidate.path.has_value(), !candidate.refusal.empty());
      refusals.insert(candidate.refusal);
      if (!candidate.path) continue;
      EXPECT_TRUE(candidate.path->At(1e9).isApprox(ring[i].T_world_camera, 1e-9));
      EXPECT_EQ(candidate.t_move_s, candidate.path->duration_s());
      EXPECT_NEAR(candidate.utility_s, 600.0 * candidate.detect_probability * candidate.gain - (0.5 + candidate.t_move_s + 1.0),
                  1e-9);
    }
    EXPECT_EQ(refusals.count(""), 3u - refusals.count("no path found"));
    EXPECT_GT(refusals.count("in collision"), 0u);
    EXPECT_GT(refusals.count("path not planned"), 0u);
    EXPECT_GT(refusals.count("too unlikely to detect"), 0u);
  }
}

TEST(Planner, TheSameGainNearerByWins) {
  const auto ring = Ring(5.0);
  const Belief belief = BeliefFrom({ring[0]}, ring);
  const std::vector<CandidateView> two = {ViewFrom(1, 25.0), ViewFrom(2, -25.0)};
  const TestMount mount;
  for (const auto& [start, wanted] : {std::pair{ViewFrom(0, 20.0), 1}, std::pair{ViewFrom(0, -20.0), 2}}) {
    const Decision decision = MakeStrategy("planner", {}, 0)->Decide(belief, two, start.T_world_camera, mount, 0.0);
    ASSERT_GE(decision.chosen, 0);
    EXPECT_EQ(Chosen(decision).view.id, wanted);
    EXPECT_NEAR(decision.candidates[0].gain, decision.candidates[1].gain, 1e-9);
  }
}

TEST(Planner, AnExpensiveTripLosesAgainstACheapOneOfLessGain) {
  const auto ring = Ring(5.0);
  const Belief belief = BeliefFrom({ring[0]}, ring);
  const std::vector<CandidateView> two = {ViewFrom(1, 25.0), ViewFrom(2, -18.0)};  // The first has more to gain.
  const auto start = ViewFrom(0, -15.0).T_world_camera;
  PlannerParams params;
  params.choose_by_rate = false;
  TestMount slow;
  slow.limits.max_speed_m_s = 0.01;
  params.worth_s = 1e5;  // Time does not matter: the greater gain.
  EXPECT_EQ(Chosen(MakeStrategy("planner", params, 0)->Decide(belief, two, start, slow, 0.0)).view.id, 1);
  params.worth_s = 600.0;
  const Decision decision = MakeStrategy("planner", params, 0)->Decide(belief, two, start, slow, 0.0);
  EXPECT_EQ(Chosen(decision).view.id, 2);
  EXPECT_GT(decision.candidates[0].gain * decision.candidates[0].detect_probability,
            decision.candidates[1].gain * decision.candidates[1].detect_probability);
}

TEST(Planner, ByRateTakesWhatLiesOnTheWay) {
  const auto ring = Ring(5.0);
  const Belief belief = BeliefFrom({ring[0]}, ring);
  const std::vector<CandidateView> two = {ViewFrom(1, 25.0), ViewFrom(2, -18.0)};  // The first has more to gain.
  const auto start = ViewFrom(0, -15.0).T_world_camera;
  PlannerParams params;
  params.worth_s = 1e5;
  TestMount slow;
  slow.limits.max_speed_m_s = 0.01;
  EXPECT_EQ(Chosen(MakeStrategy("planner", params, 0)->Decide(belief, two, start, slow, 0.0)).view.id, 2);
}

TEST(Planner, AFailureChangesTheChoiceUntilAViewIsAdded) {
  const auto ring = Ring(5.0);
  const Belief belief = BeliefFrom({ring[0]}, ring);
  const auto strategy = MakeStrategy("planner", {}, 0);
  const TestMount mount;
  const auto decide = [&] { return strategy->Decide(belief, ring, ring[0].T_world_camera, mount, 0.0); };
  const Decision before = decide();
  Attempt attempt;
  attempt.viewpoint = Chosen(before).view.viewpoint;
  attempt.looked = false;  // Of how often attempts detect it shall say nothing here.
  attempt.t_plan_s = 0.5;
  attempt.t_learn_s = 1.0;
  strategy->Report(attempt);
  const Decision after = decide();
  const auto index = static_cast<std::size_t>(before.chosen);
  EXPECT_NEAR(after.candidates[index].detect_probability, 0.3 * before.candidates[index].detect_probability, 1e-12);
  EXPECT_GT(geometry::AngleBetween(Chosen(after).view.viewpoint.direction, attempt.viewpoint.direction), 0.17);
  EXPECT_EQ(decide().chosen, after.chosen) << "asking again is not another attempt";
  attempt.view_added = true;
  attempt.viewpoint = {Direction(180.0), 0.6};
  strategy->Report(attempt);
  EXPECT_NEAR(decide().candidates[index].detect_probability, after.candidates[index].detect_probability, 1e-12)
      << "what was learned on the other side changes nothing here";
  attempt.viewpoint = {Direction(0.0), 0.6};
  strategy->Report(attempt);
  EXPECT_NEAR(decide().candidates[index].detect_probability, before.candidates[index].detect_probability, 1e-12);
}

TEST(Planner, NothingIsToBeGainedWhereItIsWellKnown) {
  const auto ring = Ring(5.0);
  const Belief belief = BeliefFrom({ring[0]}, ring);
  const auto strategy = MakeStrategy("planner", {}, 0);
  const auto decide = [&] { return strategy->Decide(belief, ring, ring[0].T_world_camera, TestMount(), 0.0); };
  const Decision before = decide();
  const measures::Viewpoint place = Chosen(before).view.viewpoint;
  strategy->Report({place, true, false, true, 0.5, 1.0});  // Seen, and no view was wanted.
  const Decision after = decide();
  EXPECT_EQ(after.completeness, before.completeness) << "it is no view";
  EXPECT_LT(after.candidates[static_cast<std::size_t>(before.chosen)].gain, 1e-9 + 0.3 * Chosen(before).gain);
  EXPECT_EQ(after.candidates[static_cast<std::size_t>(before.chosen)].refusal, "too near to a learned view");
  EXPECT_GT(geometry::AngleBetween(Chosen(after).view.viewpoint.direction, place.direction), 0.24);
}

// It was found, but no view came of it for another reason than that it is known: one is wanted still, but not at any price.
TEST(Planner, WhereNoViewCameOfItThereIsStillSomethingToLearn) {
  const auto ring = Ring(5.0);
  const Belief belief = BeliefFrom({ring[0]}, ring);
  const auto strategy = MakeStrategy("planner", {}, 0);
  const auto decide = [&] { return strategy->Decide(belief, ring, ring[0].T_world_camera, TestMount(), 0.0); };
  const Decision before = decide();
  const auto index = static_cast<std::size_t>(before.chosen);
  strategy->Report({Chosen(before).view.viewpoint, true, false, false, 0.5, 1.0});
  const Decision after = decide();
  EXPECT_EQ(after.candidates[index].gain, before.candidates[index].gain);
  EXPECT_NE(after.candidates[index].refusal, "too near to a learned view");
  EXPECT_LT(after.candidates[index].detect_probability, 0.5 * before.candidates[index].detect_probability);
  EXPECT_NE(after.chosen, before.chosen);
}

TEST(Planner, LearnsWhatThingsReallyTake) {
  const auto ring = Ring(5.0);
  const Belief belief = BeliefFrom({ring[0]}, ring);
  const auto strategy = MakeStrategy("planner", {}, 0);
  const TestMount mount;
  Attempt attempt;
  attempt.view_added = true;
  attempt.t_plan_s = 1.5;
  attempt.t_learn_s = 4.0;
  for (int i = 0; i < 9; ++i) strategy->Report(attempt);
  const Candidate candidate = strategy->Decide(belief, ring, ring[0].T_world_camera, mount, 0.0).candidates[5];
  EXPECT_NEAR(candidate.t_plan_s, (0.5 + 9 * 1.5) / 10, 1e-12);
  EXPECT_NEAR(candidate.t_learn_s, (1.0 + 9 * 4.0) / 10, 1e-12);
  attempt.t_learn_s = -1.0;
  EXPECT_THROW(strategy->Report(attempt), std::invalid_argument);
}

TEST(Planner, LearnsHowOftenAttemptsDetect) {
  const auto ring = Ring(5.0);
  const Belief belief = BeliefFrom({ring[0]}, ring);
  for (const bool detected : {false, true}) {
    const auto strategy = MakeStrategy("planner", AsMeasured(), 0);
    const auto probability = [&] {
      return strategy->Decide(belief, ring, ring[0].T_world_camera, TestMount(), 0.0).candidates[5].detect_probability;
    };
    const double predicted = measures::DetectionProbability(belief.views, ring[5].viewpoint, belief.predicted);
    ASSERT_GT(predicted, 0.3);
    ASSERT_LT(predicted, 0.9);
    EXPECT_NEAR(probability(), predicted, 1e-12);
    for (int i = 0; i < 12; ++i) {
      probability();
      strategy->Report({{Direction(180.0), 0.6}, detected, detected, false, 0.5, 1.0});
    }
    if (detected) {
      EXPECT_GT(probability(), predicted + 0.05);
    } else {
      EXPECT_LT(probability(), predicted - 0.1);
    }
  }
}

TEST(Planner, PlansFurtherPathsWhereTheBestAreRefused) {
  const auto ring = Ring(5.0);
  PlannerParams params;
  params.max_path_goals = 2;
  TestMount mount;
  mount.no_path = [](const geometry::Rigid& pose) { return pose.translation().y() > 0.0 ? "no path found" : ""; };
  const Belief belief = BeliefFrom({ring[0]}, ring);
  const Decision decision = MakeStrategy("planner", params, 0)->Decide(belief, ring, ring[0].T_world_camera, mount, 0.0);
  ASSERT_GE(decision.chosen, 0);
  EXPECT_LT(Chosen(decision).view.T_world_camera.translation().y(), 0.0);
  for (const std::size_t goals : mount.goals_planned) EXPECT_LE(goals, 2u);
}

TEST(Planner, DecidesTheSameEveryTime) {
  const auto ring = Ring(3.0);
  const Belief belief = BeliefFrom({ring[0]}, ring);
  for (const char* name : {"planner", "random", "nearest", "sweep", "coverage"}) {
    const Decision a = MakeStrategy(name, {}, 5)->Decide(belief, ring, ring[0].T_world_camera, TestMount(), 0.0);
    const Decision b = MakeStrategy(name, {}, 5)->Decide(belief, ring, ring[0].T_world_camera, TestMount(), 0.0);
    EXPECT_EQ(a.chosen, b.chosen);
  }
}

// Why it stops, one test for each reason; `ring` is reachable, its first view learned.
struct StopTest : testing::TestWithParam<const char*> {
  std::vector<CandidateView> ring = Ring(10.0);
  Belief belief = BeliefFrom({ring[0]}, ring);
  PlannerParams params;
  TestMount mount;

  Decision Decide(double elapsed_s = 0.0, int attempts = 0) {
    const auto strategy = MakeStrategy(GetParam(), params, 0);
    for (int i = 0; i < attempts; ++i) strategy->Report({{Direction(180.0), 0.6}, true, true, false, 0.5, 1.0});
    const Decision decision = strategy->Decide(belief, ring, ring[0].T_world_camera, mount, elapsed_s);
    EXPECT_EQ(decision.chosen < 0, decision.stop != StopReason::kNone);
    return decision;
  }
};

TEST_P(StopTest, GoesOnWhereThereIsSomethingToLearn) { EXPECT_EQ(Decide(899.9, 59).stop, StopReason::kNone); }

TEST_P(StopTest, AtTheTarget) {
  params.target_completeness = Decide().completeness - 1e-6;
  EXPECT_EQ(Decide(1e9, 100).stop, StopReason::kTargetReached) << "before all other reasons";
}

TEST_P(StopTest, AtTheTimeBudget) { EXPECT_EQ(Decide(900.0).stop, StopReason::kTimeBudget); }

TEST_P(StopTest, AfterTooManyAttempts) { EXPECT_EQ(Decide(0.0, 60).stop, StopReason::kMaxAttempts); }

TEST_P(StopTest, WhereTheMountRefusesAll) {
  mount.unreachable = [](const geometry::Rigid&) { return "out of the workspace"; };
  EXPECT_EQ(Decide().stop, StopReason::kNothingReachable);
  for (const Candidate& candidate : Decide().candidates) EXPECT_FALSE(candidate.refusal.empty());
}

TEST_P(StopTest, WhereNoPathIsFound) {
  mount.no_path = [](const geometry::Rigid&) { return "no path found"; };
  EXPECT_EQ(Decide().stop, StopReason::kNothingReachable);
}

TEST_P(StopTest, WithoutCandidates) {
  ring.resize(1);
  const auto strategy = MakeStrategy(GetParam(), params, 0);
  EXPECT_EQ(strategy->Decide(belief, {}, ring[0].T_world_camera, mount, 0.0).stop, StopReason::kNothingReachable);
}

INSTANTIATE_TEST_SUITE_P(All, StopTest, testing::Values("planner", "random", "nearest", "sweep", "coverage"),
                         [](const auto& one) { return std::string(one.param); });

using PlannerStops = StopTest;
INSTANTIATE_TEST_SUITE_P(Planner, PlannerStops, testing::Values("planner"));

TEST_P(PlannerStops, WhenNothingIsWorthItsCost) {
  params.worth_s = 1.0;
  EXPECT_EQ(Decide().stop, StopReason::kNothingWorthwhile);
}

TEST_P(PlannerStops, WhenOnlyTheTripIsTooLong) {
  mount.limits.max_speed_m_s = 0.0005;
  EXPECT_EQ(Decide().stop, StopReason::kNothingWorthwhile);
}

TEST_P(PlannerStops, WhenAllIsKnownAlready) {
  params.target_completeness = 1.0;
  belief.views.clear();
  for (int azimuth = 0; azimuth < 360; azimuth += 20) belief.views.push_back({Direction(azimuth), 0.6});
  EXPECT_EQ(Decide().stop, StopReason::kNothingWorthwhile);
}

TEST_P(PlannerStops, ButAWorthlessPlaceOutOfReachIsNoReason) {
  // What would be worth something is reachable, at too great a cost; the rest is out of reach.
  mount.unreachable = [](const geometry::Rigid& pose) { return pose.translation().x() < 0.0 ? "in collision" : ""; };
  params.worth_s = 1.0;
  EXPECT_EQ(Decide().stop, StopReason::kNothingWorthwhile);
}

// The closed loop with a learner that behaves as predicted, or never learns from one side at all.
struct LoopResult {
  std::vector<int> ids;
  StopReason stop = StopReason::kNone;
  double completeness = 0.0, elapsed_s = 0.0;
};

// `seen`: it is detected also where no view comes of it.
LoopResult RunLoop(const std::string& name, const std::function<bool(const Candidate&)>& succeeds, std::uint32_t seed = 0,
                   bool seen = false) {
  const auto ring = Ring(5.0);
  const TestMount mount;
  Belief belief = BeliefFrom({ring[0]}, ring);
  const auto strategy = MakeStrategy(name, {}, seed);
  geometry::Rigid pose = ring[0].T_world_camera;
  LoopResult result;
  for (int step = 0; step < 1000; ++step) {
    const Decision decision = strategy->Decide(belief, ring, pose, mount, result.elapsed_s);
    result.completeness = decision.completeness;
    result.stop = decision.stop;
    if (decision.chosen < 0) return result;
    const Candidate& chosen = Chosen(decision);
    pose = chosen.view.T_world_camera;
    result.elapsed_s += chosen.t_plan_s + chosen.t_move_s + chosen.t_learn_s;
    result.ids.push_back(chosen.view.id);
    const bool added = succeeds(chosen);
    if (added) belief.views.push_back(chosen.view.viewpoint);
    strategy->Report({chosen.view.viewpoint, added || seen, added, false, 0.5, 1.0});
  }
  return result;
}

TEST(Loop, ThePlannerGoesAllAroundAndStopsForAReason) {
  const LoopResult result = RunLoop("planner", [](const Candidate& candidate) { return candidate.detect_probability > 0.3; });
  EXPECT_EQ(result.stop, StopReason::kTargetReached);
  EXPECT_GE(result.completeness, 0.97);
  EXPECT_LT(result.ids.size(), 30u);
}

TEST(Loop, AFailedAttemptIsNotRepeatedForEver) {
  const LoopResult never = RunLoop("planner", [](const Candidate&) { return false; });
  EXPECT_EQ(never.stop, StopReason::kNothingWorthwhile);
  EXPECT_LT(never.ids.size(), 15u);
  const LoopResult one_side =
      RunLoop("planner", [](const Candidate& candidate) { return candidate.view.viewpoint.direction.y() > -0.01; });
  EXPECT_EQ(one_side.stop, StopReason::kNothingWorthwhile);
  EXPECT_LT(one_side.ids.size(), 40u);
  EXPECT_GT(one_side.completeness, 0.5);
  const LoopResult seen_only = RunLoop(
      "planner", [](const Candidate&) { return false; }, 0, true);
  EXPECT_EQ(seen_only.stop, StopReason::kNothingWorthwhile);
  EXPECT_LT(seen_only.ids.size(), 30u);
}

TEST(Loop, RandomTriesEveryViewOnceAndThenStops) {
  PlannerParams params;
  const LoopResult result = RunLoop(
      "random", [](const Candidate&) { return false; }, 3);
  EXPECT_EQ(std::set<int>(result.ids.begin(), result.ids.end()).size(), result.ids.size());
  EXPECT_EQ(result.ids.size(), static_cast<std::size_t>(params.max_attempts));
  EXPECT_EQ(result.stop, StopReason::kMaxAttempts);
  EXPECT_NE(result.ids, RunLoop(
                            "random", [](const Candidate&) { return false; }, 4)
                            .ids);
}

TEST(Loop, RandomStopsWhereNothingIsLeft) {
  const auto ring = Ring(60.0);
  const Belief belief = BeliefFrom({ring[0]}, ring);
  const auto strategy = MakeStrategy("random", {}, 0);
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Decision decision = strategy->Decide(belief, ring, ring[0].T_world_camera, TestMount(), 0.0);
    ASSERT_GE(decision.chosen, 0);
    strategy->Report({Chosen(decision).view.viewpoint, false, false, false, 0.5, 1.0});
  }
  const Decision last = strategy->Decide(belief, ring, ring[0].T_world_camera, TestMount(), 0.0);
  EXPECT_EQ(last.stop, StopReason::kNothingReachable);
  for (const Candidate& candidate : last.candidates) EXPECT_EQ(candidate.refusal, "already tried");
}

TEST(Loop, ThePlannerBeatsRandom) {
  // The learner that both have: it finds the object where the belief without failures says so.
  const auto succeeds = [](const Candidate& candidate) { return candidate.detect_probability > 0.3; };
  const LoopResult planner = RunLoop("planner", succeeds);
  std::vector<double> times_s;
  for (std::uint32_t seed = 0; seed < 9; ++seed) {
    const LoopResult random = RunLoop("random", succeeds, seed);
    times_s.push_back(random.stop == StopReason::kTargetReached ? random.elapsed_s : 1e9);
  }
  std::nth_element(times_s.begin(), times_s.begin() + 4, times_s.end());
  EXPECT_LT(planner.elapsed_s, times_s[4]);
}

TEST(MakeStrategy, RefusesOtherNamesAndBadParams) {
  EXPECT_THROW(MakeStrategy("greedy", {}, 0), std::invalid_argument);
  PlannerParams params;
  params.failure_discount = 1.0;
  EXPECT_THROW(MakeStrategy("planner", params, 0), std::invalid_argument);
}

TEST(StopReason, HasWords) {
  EXPECT_EQ(ToString(StopReason::kTargetReached), "target_reached");
  EXPECT_EQ(ToString(StopReason::kNothingWorthwhile), "nothing_worth_its_cost");
  EXPECT_EQ(ToString(StopReason::kNothingReachable), "nothing_reachable");
  EXPECT_EQ(ToString(StopReason::kTimeBudget), "time_budget");
  EXPECT_EQ(ToString(StopReason::kMaxAttempts), "max_attempts");
  EXPECT_EQ(ToString(StopReason::kOperator), "operator");
  EXPECT_EQ(ToString(StopReason::kNone), "none");
}

}  // namespace
}  // namespace vantage::exploration
