// Interest points of a whole 640 x 480 photograph on one thread and on two. The calling thread's processor time (`caller_ms`) is
// what the extraction takes where the other core is free, whatever else the machine does.
#include <benchmark/benchmark.h>

#include <ctime>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>

#include "features/features.h"
#include "features/memory.h"
#include "textured_objects.h"

namespace {

using namespace vantage;

double CallerNow() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// Arguments: 0 SIFT, 1 SURF; threads.
void Extract(benchmark::State& state) {
  cv::Mat gray;
  cv::cvtColor(benchmarks::Photographs()[0], gray, cv::COLOR_BGR2GRAY);
  cv::resize(gray, gray, cv::Size(640, 480), 0.0, 0.0, cv::INTER_AREA);
  features::FeatureParams params;
  if (state.range(0) == 1) params.type = "surf";
  features::KeepFreedMemory();  // As the programs do.
  const int threads = cv::getNumThreads();
  cv::setNumThreads(static_cast<int>(state.range(1)));
  double caller_s = 0.0;
  for (auto _ : state) {
    const double start = CallerNow();
    const features::Features features = features::Extract(gray, {}, params);
    caller_s += CallerNow() - start;
    state.counters["points"] = features.size();
  }
  cv::setNumThreads(threads);
  state.counters["caller_ms"] = 1000.0 * caller_s / static_cast<double>(state.iterations());
}
BENCHMARK(Extract)
    ->ArgNames({"surf", "threads"})
    ->ArgsProduct({{0, 1}, {1, 2}})
    ->Iterations(20)
    ->UseRealTime()
    ->MeasureProcessCPUTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
