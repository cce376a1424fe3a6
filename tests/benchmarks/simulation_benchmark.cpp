// What a look at the shipped world costs: 10 Hz beside the other processes leave 100 ms a frame, and one core.
#include <benchmark/benchmark.h>

#include <cmath>

#include "simulation/simulated_world.h"

namespace {

using namespace vantage;

const char* const kWorld = VANTAGE_SOURCE_DIR "/config/worlds/table.yaml";

void LookAtTable(benchmark::State& state) {
  const simulation::SimulatedWorld world(simulation::LoadWorldParams(kWorld));
  std::uint32_t frame = 0;
  for (auto _ : state) {
    const double azimuth = 0.7 * frame;
    const Eigen::Vector3d eye(0.55 * std::cos(azimuth), 0.55 * std::sin(azimuth), 0.25 + 0.05 * (frame % 5));
    const geometry::Rigid pose = geometry::LookAt(eye, {0, 0, 0.1}, {0, 0, 1});
    benchmark::DoNotOptimize(world.Look(pose, frame++).color.data);
  }
}
BENCHMARK(LookAtTable)->Unit(benchmark::kMillisecond)->UseRealTime();

void BuildWorld(benchmark::State& state) {
  const simulation::WorldParams params = simulation::LoadWorldParams(kWorld);
  for (auto _ : state) simulation::SimulatedWorld world(params);
}
BENCHMARK(BuildWorld)->Unit(benchmark::kMillisecond);

}  // namespace
