// How long refinement takes: a global and a local adjustment of an orbit of 40 views with about 300 features each, a closed loop,
// and the upkeep of the result.
#include <benchmark/benchmark.h>

#include "learning/box_orbit.h"
#include "learning/loop_closure.h"
#include "learning/refinement.h"
#include "learning/upkeep.h"

namespace {

using namespace vantage;

const model::ObjectModel& Orbit() {
  static const testing::BoxOrbit orbit([] {
    testing::BoxOrbitOptions options;
    options.views = 40;
    options.points_per_side = 260;
    options.drift_m = 0.0005;
    options.drift_deg = 0.1;
    return options;
  }());
  return orbit.object();
}

// Argument: how many of the newest views are free; 39 = global.
void Refine(benchmark::State& state) {
  const int first_free = static_cast<int>(Orbit().views.size()) - static_cast<int>(state.range(0));
  learning::RefinementReport report;
  for (auto _ : state) benchmark::DoNotOptimize(learning::Refined(Orbit(), first_free, {}, &report));
  state.counters["observations"] = report.bundle.observations;
  state.counters["points"] = report.bundle.points;
  state.counters["iterations"] = report.bundle.iterations;
}
BENCHMARK(Refine)->Arg(39)->Arg(6)->Arg(3)->Unit(benchmark::kMillisecond);

void CloseLoop(benchmark::State& state) {
  learning::ClosureReport report;
  for (auto _ : state) benchmark::DoNotOptimize(learning::WithLoopClosed(Orbit(), 39, {}, {}, &report));
  state.counters["links"] = report.links;
}
BENCHMARK(CloseLoop)->Unit(benchmark::kMillisecond);

void FindLinks(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(learning::FindLinks(Orbit(), 39, {}));
}
BENCHMARK(FindLinks)->Unit(benchmark::kMillisecond);

void Keep(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(learning::Kept(Orbit(), {}, {}));
}
BENCHMARK(Keep)->Unit(benchmark::kMillisecond);

}  // namespace
