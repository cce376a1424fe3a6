// What cutting out the objects of a 640 x 480 frame costs, on a simulated table with a Kinect's errors: five boxes, some stacked
// and some touching.
#include <benchmark/benchmark.h>

#include "segmentation/clusters.h"
#include "segmentation/plane.h"
#include "simulation/simulated_world.h"

namespace {

using namespace vantage;

const rgbd::Frame& CrowdedTable() {
  static const rgbd::Frame frame = [] {
    simulation::WorldParams params;
    const std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> boxes = {{{0.2, 0.25, 0.08}, {0.0, 0.0, 0.0}},
                                                                            {{0.07, 0.1, 0.16}, {0.02, 0.0, 0.08}},
                                                                            {{0.1, 0.15, 0.2}, {-0.2, 0.18, 0.0}},
                                                                            {{0.12, 0.08, 0.15}, {-0.2, -0.22, 0.0}},
                                                                            {{0.12, 0.08, 0.1}, {-0.18, -0.3, 0.0}}};
    for (const auto& [size_m, position_m] : boxes) {
      simulation::ObjectParams box;
      box.name = "box" + std::to_string(params.objects.size());
      box.box_m = size_m;
      box.position_m = position_m;
      box.faces = {"fruits.jpg"};
      params.objects.push_back(box);
    }
    const simulation::SimulatedWorld world(params);
    return world.Look(geometry::LookAt({0.8, 0.1, 0.5}, {-0.05, 0.0, 0.05}, {0, 0, 1}), 1);
  }();
  return frame;
}

void FitPlane(benchmark::State& state) {
  const rgbd::Frame& frame = CrowdedTable();
  for (auto _ : state) benchmark::DoNotOptimize(segmentation::FitPlane(frame, {}));
}
BENCHMARK(FitPlane)->Unit(benchmark::kMillisecond);

void FindClusters(benchmark::State& state) {
  const rgbd::Frame& frame = CrowdedTable();
  const auto plane = segmentation::FitPlane(frame, {});
  std::size_t clusters = 0;
  for (auto _ : state) clusters = segmentation::FindClusters(frame, *plane, {}).size();
  state.counters["clusters"] = static_cast<double>(clusters);
}
BENCHMARK(FindClusters)->Unit(benchmark::kMillisecond);

}  // namespace
