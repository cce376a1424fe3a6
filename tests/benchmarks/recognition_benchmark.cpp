// One 640 x 480 frame among 10, 100 and 1000 known objects: ten of them stand on a table, the rest are to be told apart from them.
// Wall-clock milliseconds of every stage, and how many of the ten were found (pose within 40 mm, p >= 0.5).
#include <benchmark/benchmark.h>

#include <chrono>
#include <map>
#include <opencv2/core/utility.hpp>

#include "recognition/recogniser.h"
#include "textured_objects.h"

namespace {

using namespace vantage;

constexpr std::uint32_t kShapeSeed = 2;
constexpr int kViews = 5;
constexpr int kOnTable = 10;
constexpr int kTables = 5;

double Now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

std::string NameOf(int number) { return "object " + std::to_string(number); }

// The first `count` objects; they are made once, which takes a second for six of them on two cores.
std::vector<std::shared_ptr<const model::ObjectModel>> Objects(int count, const features::FeatureParams& params) {
  static std::vector<std::shared_ptr<const model::ObjectModel>> objects;
  const int had = static_cast<int>(objects.size());
  if (had < count) {
    objects.resize(count);
    benchmarks::Photographs();
    cv::parallel_for_(cv::Range(had, count), [&](const cv::Range& range) {
      for (int i = range.start; i < range.end; ++i) {
        objects[i] = benchmarks::Learn(NameOf(i), benchmarks::MakeShape(i, kShapeSeed), kViews, params);
      }
    });
  }
  return {objects.begin(), objects.begin() + count};
}

// Whichever ten objects are asked for stand there.
std::vector<benchmarks::TableScene> Tables(int known) {
  std::vector<benchmarks::TableScene> tables;
  for (int t = 0; t < kTables; ++t) {
    std::vector<int> numbers;
    for (int i = 0; i < kOnTable; ++i) numbers.push_back((t * 331 + i * known / kOnTable) % known);
    tables.push_back(benchmarks::MakeTable(numbers, kShapeSeed, 100 + static_cast<std::uint32_t>(t)));
  }
  return tables;
}

struct Tally {
  int right = 0;
  int wrong = 0;
};

Tally Judge(const std::vector<recognition::Detection>& detections, const benchmarks::TableScene& table,
            const std::vector<std::shared_ptr<const model::ObjectModel>>& objects) {
  Tally tally;
  for (const recognition::Detection& detection : detections) {
    if (detection.probability < 0.5) continue;
    bool right = false;
    for (const auto& [number, T_camera_object] : table.truth) {
      right =
          right || (detection.object == NameOf(number) &&
                    model::MeanPointDistance(objects[number]->PointMatrix(), detection.T_camera_object, T_camera_object) < 0.04);
    }
    (right ? tally.right : tally.wrong) += 1;
  }
  return tally;
}

void RecogniseTable(benchmark::State& state) {
  const int known = static_cast<int>(state.range(0));
  recognition::RecogniserParams params;
  if (state.range(1) == 1) params.matching.exhaustive_points = 100000000;
  if (state.range(1) == 2) params.matching.ranking = "score";
  const auto objects = Objects(known, params.features);
  const auto tables = Tables(known);
  recognition::Recogniser recogniser(params);
  double start = Now();
  std::size_t points = 0;
  for (const auto& object : objects) {
    recogniser.Set(object);
    for (const auto& view : object->views) points += view.points.size();
  }
  state.counters["set_ms"] = 1000.0 * (Now() - start) / known;
  double extract_s = 0.0;
  recognition::StageTimes sum;
  Tally tally;
  int frames = 0;
  for (auto _ : state) {
    const benchmarks::TableScene& table = tables[frames % kTables];
    start = Now();
    const features::Features features = recogniser.Extract(table.frame);
    extract_s += Now() - start;
    recognition::StageTimes times;
    const auto detections = recogniser.Recognise(table.frame, features, {}, &times);
    sum.match_s += times.match_s;
    sum.vote_s += times.vote_s;
    sum.pose_s += times.pose_s;
    sum.verify_s += times.verify_s;
    const Tally one = Judge(detections, table, objects);
    tally.right += one.right;
    tally.wrong += one.wrong;
    state.counters["keypoints"] = features.size();
    ++frames;
  }
  const auto ms = [&](double seconds) { return 1000.0 * seconds / frames; };
  state.counters["extract_ms"] = ms(extract_s);
  state.counters["match_ms"] = ms(sum.match_s);
  state.counters["vote_ms"] = ms(sum.vote_s);
  state.counters["pose_ms"] = ms(sum.pose_s);
  state.counters["verify_ms"] = ms(sum.verify_s);
  state.counters["right_of_10"] = static_cast<double>(tally.right) / frames;
  state.counters["wrong"] = static_cast<double>(tally.wrong) / frames;
  state.counters["points"] = static_cast<double>(points);
}
// Matching: 0 as configured (tree), 1 all compared, 2 candidates by score (5).
BENCHMARK(RecogniseTable)
    ->ArgNames({"known", "matching"})
    ->Args({10, 0})
    ->Args({10, 1})
    ->Args({100, 0})
    ->Args({100, 1})
    ->Args({100, 2})
    ->Args({1000, 0})
    ->Iterations(2 * kTables)
    ->UseRealTime()
    ->MeasureProcessCPUTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
