// How long the planner thinks: paths to many goals around a table with three things on it, gains alone, one full decision.
#include <benchmark/benchmark.h>

#include "exploration/planner.h"
#include "geometry/view_sphere.h"

namespace {

using namespace vantage;

motion::Obstacles TableWithThreeThings() {
  motion::Obstacles obstacles;
  motion::BoxObstacle table;
  table.name = "table";
  table.T_world_box.translation().z() = -0.02;
  table.size_m = Eigen::Vector3d(1.2, 0.8, 0.04);
  obstacles.boxes.push_back(table);
  for (const double x : {-0.3, 0.0, 0.3}) {
    motion::HullObstacle thing;
    for (const Eigen::Vector3d& direction : geometry::EvenDirections(800)) {
      thing.points_in_world.emplace_back(Eigen::Vector3d(x, x / 3.0, 0.12) + 0.1 * direction);
    }
    obstacles.hulls.push_back(thing);
  }
  return obstacles;
}

std::vector<exploration::CandidateView> Around(int directions) {
  exploration::CandidateParams params;
  params.directions = directions;
  params.distances_m = {0.55};
  geometry::Rigid T_world_object = geometry::Rigid::Identity();
  T_world_object.translation().z() = 0.1;
  return exploration::SampleCandidates(T_world_object, params);
}

// About as many goals as the argument says, from a low corner: a good part needs the roadmap.
void PlanPaths(benchmark::State& state) {
  std::vector<geometry::Rigid> goals;
  for (const auto& candidate : Around(static_cast<int>(state.range(0) * 2.45))) goals.push_back(candidate.T_world_camera);
  const auto start = geometry::LookAt({-0.6, 0.1, 0.12}, {0.0, 0.0, 0.1}, Eigen::Vector3d::UnitZ());
  const motion::Obstacles obstacles = TableWithThreeThings();
  int bent = 0;
  for (auto _ : state) {
    const auto results = motion::MakeFreeMount({}, obstacles)->Plan(start, goals, 0);
    bent = 0;
    for (std::size_t i = 0; i < goals.size(); ++i) {
      const double straight_m = (goals[i].translation() - start.translation()).norm();
      if (results[i].trajectory && results[i].trajectory->duration_s() > straight_m / 0.25 + 0.55) ++bent;
    }
  }
  state.counters["goals"] = static_cast<double>(goals.size());
  state.counters["not_straight"] = bent;
}
BENCHMARK(PlanPaths)->Arg(15)->Arg(150)->Unit(benchmark::kMillisecond);

// The arm among the same things: paths to all of about 160 and 300 views, everything made anew as for a decision; and the
// shortening of the one that is driven.
void PlanArmPaths(benchmark::State& state) {
  motion::MountParams params;
  params.type = "arm";
  params.arm.urdf = VANTAGE_SOURCE_DIR "/config/robots/arm.urdf";
  const motion::MountMaker maker(params);
  const motion::Obstacles obstacles = TableWithThreeThings();
  std::vector<geometry::Rigid> goals;
  for (const auto& candidate : Around(static_cast<int>(state.range(0) * 2.45))) goals.push_back(candidate.T_world_camera);
  const auto start = maker.Make(obstacles)->StanceAt(geometry::LookAt({0.4, 0.1, 0.4}, {0.0, 0.0, 0.1}, Eigen::Vector3d::UnitZ()));
  if (!start) return state.SkipWithError("the start is out of reach");
  double with_path = 0, shortened_s = 0, planned_s = 0;
  for (auto _ : state) {
    const auto mount = maker.Make(obstacles);
    const auto results = mount->Plan(*start, goals, 0);
    with_path = planned_s = shortened_s = 0;
    const motion::Trajectory* longest = nullptr;
    for (const auto& result : results) {
      if (!result.trajectory) continue;
      ++with_path;
      if (longest == nullptr || result.trajectory->duration_s() > longest->duration_s()) longest = &*result.trajectory;
    }
    if (longest == nullptr) continue;
    planned_s = longest->duration_s();
    shortened_s = mount->Shortened(*longest, 0).duration_s();
  }
  state.counters["goals"] = static_cast<double>(goals.size());
  state.counters["with_path"] = with_path;
  state.counters["longest_s"] = planned_s;
  state.counters["shortened_s"] = shortened_s;
}
BENCHMARK(PlanArmPaths)->Arg(160)->Arg(300)->Unit(benchmark::kMillisecond)->UseRealTime();

// 200 candidates, 500 query directions, 20 learned views; with paths or scored alone.
void Decide(benchmark::State& state) {
  const auto candidates = Around(490);
  exploration::Belief belief;
  for (int i = 0; i < 20; ++i) belief.views.push_back(candidates[static_cast<std::size_t>(i) * 4].viewpoint);
  for (const auto& candidate : Around(1220)) belief.reachable.push_back({candidate.viewpoint, 1.0});
  exploration::PlannerParams params;
  params.rule = static_cast<measures::CompletenessRule>(state.range(0));
  params.target_completeness = 1.0;
  motion::FreeMountParams mount_params;
  if (state.range(1) == 0) mount_params.workspace_upper_m = Eigen::Vector3d(-1.4, -1.4, -0.4);  // All refused: scoring alone.
  const auto mount = motion::MakeFreeMount(mount_params, TableWithThreeThings());
  const motion::Stance start(geometry::LookAt({-0.6, 0.1, 0.12}, {0.0, 0.0, 0.1}, Eigen::Vector3d::UnitZ()));
  const auto strategy = exploration::MakeStrategy("planner", params, 0);
  for (auto _ : state) benchmark::DoNotOptimize(strategy->Decide(belief, candidates, start, *mount, 0.0));
  state.counters["candidates"] = static_cast<double>(candidates.size());
  state.counters["queries"] = static_cast<double>(belief.reachable.size());
}
BENCHMARK(Decide)->ArgsProduct({{0, 1, 2}, {0, 1}})->ArgNames({"rule", "paths"})->Unit(benchmark::kMillisecond);

// One full decision for the arm, as `explore` makes it: the mount made anew, scores, paths to all that may be worth it, the best
// one shortened.
void DecideArm(benchmark::State& state) {
  motion::MountParams mount_params;
  mount_params.type = "arm";
  mount_params.arm.urdf = VANTAGE_SOURCE_DIR "/config/robots/arm.urdf";
  const motion::MountMaker maker(mount_params);
  const motion::Obstacles obstacles = TableWithThreeThings();
  const auto candidates = Around(static_cast<int>(state.range(0) * 2.45));
  exploration::Belief belief;
  for (std::size_t i = 0; i < 6; ++i) belief.views.push_back(candidates[i * candidates.size() / 6].viewpoint);
  for (const auto& candidate : candidates) belief.reachable.push_back({candidate.viewpoint, 1.0});
  exploration::PlannerParams params;
  params.target_completeness = 1.0;
  params.min_detect_probability = 0.0;  // Everything is planned for.
  params.min_view_angle_rad = 0.0;
  params.max_path_goals = 1000;
  const auto start = maker.Make(obstacles)->StanceAt(geometry::LookAt({0.4, 0.1, 0.4}, {0.0, 0.0, 0.1}, Eigen::Vector3d::UnitZ()));
  if (!start) return state.SkipWithError("the start is out of reach");
  const auto strategy = exploration::MakeStrategy("planner", params, 0);
  double with_path = 0;
  for (auto _ : state) {
    const auto decision = strategy->Decide(belief, candidates, *start, *maker.Make(obstacles), 0.0);
    with_path = 0;
    for (const auto& candidate : decision.candidates) with_path += candidate.path.has_value();
  }
  state.counters["candidates"] = static_cast<double>(candidates.size());
  state.counters["with_path"] = with_path;
}
BENCHMARK(DecideArm)->Arg(160)->Arg(300)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
