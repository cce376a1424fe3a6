// One 640 x 480 frame among 10, 100 and 1000 known objects: ten of them stand on a table, the rest are to be told apart from them.
// Wall-clock milliseconds of every stage, and how many of the ten were found (pose within 40 mm, p >= 0.5). On a shared machine:
// `caller_ms` is the calling thread's processor time, near what a frame takes where the other core is free to help; `quiet_ms` the
// wall-clock time of the `quiet` frames during which other programs had less than a tenth of a core.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <chrono>
#include <ctime>
#include <fstream>
#include <map>
#include <opencv2/core/utility.hpp>

#include "features/memory.h"
#include "recognition/recogniser.h"
#include "textured_objects.h"

namespace {

using namespace vantage;

constexpr std::uint32_t kShapeSeed = 2;
constexpr int kViews = 5;
constexpr int kOnTable = 10;
constexpr int kTables = 5;

double Now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

// Of the calling thread, seconds.
double CallerNow() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// Processor time that others than this process have had, seconds, in steps of 10 ms.
double OthersNow() {
  std::ifstream stream("/proc/stat");
  std::string name;
  double user = 0.0, nice = 0.0, system = 0.0, idle = 0.0, wait = 0.0, irq = 0.0, soft_irq = 0.0, stolen = 0.0;
  stream >> name >> user >> nice >> system >> idle >> wait >> irq >> soft_irq >> stolen;
  const double all = (user + nice + system + irq + soft_irq + stolen) / static_cast<double>(sysconf(_SC_CLK_TCK));
  return all - static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

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
  features::KeepFreedMemory();  // As the programs do.
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
  double extract_s = 0.0, extract_caller_s = 0.0, caller_s = 0.0, quiet_s = 0.0;
  recognition::StageTimes sum;
  Tally tally;
  int frames = 0, quiet = 0;
  for (auto _ : state) {
    const benchmarks::TableScene& table = tables[frames % kTables];
    const double others = OthersNow(), caller = CallerNow();
    const double begin = start = Now();
    const features::Features features = recogniser.Extract(table.frame);
    extract_s += Now() - start;
    extract_caller_s += CallerNow() - caller;
    recognition::StageTimes times;
    const auto detections = recogniser.Recognise(table.frame, features, {}, &times);
    const double whole_s = Now() - begin;
    caller_s += CallerNow() - caller;
    if (OthersNow() - others < 0.1 * whole_s) {
      ++quiet;
      quiet_s += whole_s;
    }
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
  state.counters["extract_caller_ms"] = ms(extract_caller_s);
  state.counters["caller_ms"] = ms(caller_s);
  state.counters["quiet"] = quiet;
  state.counters["quiet_ms"] = quiet > 0 ? 1000.0 * quiet_s / quiet : 0.0;
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
    ->Iterations(4 * kTables)
    ->UseRealTime()
    ->MeasureProcessCPUTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
