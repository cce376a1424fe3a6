// The vocabulary tree at size: what a query and a view cost, and whether the right object comes first. Descriptors are made up: 64
// values of 16 degrees of freedom, so that they crowd as real ones do; a view shows 300 of its object's 600 points.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <cmath>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <map>
#include <numeric>
#include <utility>

#include "features/features.h"
#include "recognition/inverted_file.h"

namespace {

using namespace vantage;
using recognition::InvertedFile;
using recognition::VocabularyTree;

constexpr int kLength = 64;
constexpr int kDegrees = 16;
constexpr int kViewPoints = 300;
constexpr int kObjectPoints = 600;
constexpr int kViewsPerObject = 10;

// Processor time, seconds: others use the machine too.
double Now() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

// PCG (O'Neill, 2014), of 32 bits: half of a filling would else go to making numbers.
class Random {
 public:
  explicit Random(std::uint32_t seed) : state_(0x9e3779b97f4a7c15u * (seed + 1u)) {}
  std::uint32_t operator()() {
    const std::uint64_t state = std::exchange(state_, state_ * 6364136223846793005u + 1442695040888963407u);
    return static_cast<std::uint32_t>((state ^ (state >> 22)) >> (22 + (state >> 61)));
  }

 private:
  std::uint64_t state_;
};

float Uniform(Random& random) { return static_cast<float>(random()) * 0x1p-32f; }

// Of variance 1, near enough to normal.
float Bell(Random& random) { return (Uniform(random) + Uniform(random) + Uniform(random) - 1.5f) * 2.f; }

const cv::Mat& Basis() {
  static const cv::Mat basis = [] {
    Random random(1);
    cv::Mat matrix(kDegrees, kLength, CV_32F);
    for (int i = 0; i < kDegrees * kLength; ++i) matrix.ptr<float>()[i] = Bell(random);
    return matrix;
  }();
  return basis;
}

void Normalise(float* row) {
  float sum = 0.f;
  for (int i = 0; i < kLength; ++i) sum += row[i] * row[i];
  for (int i = 0; i < kLength; ++i) row[i] /= std::sqrt(sum);
}

cv::Mat Descriptors(int rows, std::uint32_t seed) {
  Random random(seed);
  cv::Mat latent(rows, kDegrees, CV_32F);
  for (int i = 0; i < rows * kDegrees; ++i) latent.ptr<float>()[i] = Bell(random);
  cv::Mat descriptors = latent * Basis();
  for (int r = 0; r < rows; ++r) Normalise(descriptors.ptr<float>(r));
  return descriptors;
}

cv::Mat ObjectPoints(int object) { return Descriptors(kObjectPoints, 1000 + static_cast<std::uint32_t>(object)); }

// The object from one side: half of its points, each descriptor off by about `noise`.
cv::Mat ViewOf(const cv::Mat& points, double view, float noise, std::uint32_t seed) {
  Random random(seed);
  cv::Mat rows(kViewPoints, kLength, CV_32F);
  const int first = static_cast<int>(view / kViewsPerObject * kObjectPoints);
  for (int r = 0; r < kViewPoints; ++r) {
    const float* point = points.ptr<float>((first + r) % kObjectPoints);
    float* row = rows.ptr<float>(r);
    for (int i = 0; i < kLength; ++i) row[i] = point[i] + (Uniform(random) - 0.5f) * noise * std::sqrt(12.f / kLength);
    Normalise(row);
  }
  return rows;
}

cv::Mat LearnedView(int object, int view) {
  return ViewOf(ObjectPoints(object), view, 0.2f, static_cast<std::uint32_t>(object * kViewsPerObject + view));
}

// Between two learned views, and noisier.
cv::Mat QueryView(int object, std::uint32_t seed) { return ViewOf(ObjectPoints(object), seed % 10 + 0.5, 0.35f, 77 + seed); }

recognition::VocabularyParams Branching(int branching, int depth) {
  recognition::VocabularyParams params;
  params.branching = branching;
  params.depth = depth;
  return params;
}

// 10^4 leaves, trained on descriptors of no object here.
const VocabularyTree& Stock() {
  static const VocabularyTree tree = VocabularyTree::Train("made up", Descriptors(300000, 5), Branching(10, 4));
  return tree;
}

struct Filled {
  InvertedFile file;
  std::vector<double> insert_ms;  // Of every view.

  double MeanInsertMs() const { return std::accumulate(insert_ms.begin(), insert_ms.end(), 0.0) / insert_ms.size(); }
};

// Views of objects, each view after the other; `max_leaf_points` 0: the tree stays as trained.
Filled Fill(int objects, int max_leaf_points) {
  recognition::InvertedFileParams params;
  params.max_leaf_points = max_leaf_points;
  Filled filled{InvertedFile(Stock(), params), {}};
  for (int object = 0; object < objects; ++object) {
    const cv::Mat points = ObjectPoints(object);
    for (int view = 0; view < kViewsPerObject; ++view) {
      const cv::Mat rows = ViewOf(points, view, 0.2f, static_cast<std::uint32_t>(object * kViewsPerObject + view));
      const double start = Now();
      filled.file.SetView(object, view, rows);
      filled.insert_ms.push_back(1000.0 * (Now() - start));
    }
  }
  return filled;
}

// Kept for several benchmarks, the last one only.
const Filled& FilledFile(int objects, int max_leaf_points) {
  static std::map<std::pair<int, int>, std::unique_ptr<Filled>> kept;
  auto& filled = kept[{objects, max_leaf_points}];
  if (!filled) {
    auto made = std::make_unique<Filled>(Fill(objects, max_leaf_points));
    for (auto& [key, other] : kept) other.reset();
    filled = std::move(made);
  }
  return *filled;
}

// Score (5) of a whole query: quantise, rank. Arguments: views, points a leaf may hold (0: static tree), paths.
void Query(benchmark::State& state) {
  const int objects = static_cast<int>(state.range(0)) / kViewsPerObject, paths = static_cast<int>(state.range(2));
  const Filled& filled = FilledFile(objects, static_cast<int>(state.range(1)));
  const InvertedFile& file = filled.file;
  std::vector<cv::Mat> queries;
  for (int q = 0; q < 200; ++q) queries.push_back(QueryView(q * 7919 % objects, static_cast<std::uint32_t>(q)));
  std::size_t at = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(file.Rank(file.tree().Quantise(queries[at], paths), 20, paths));
    at = (at + 1) % queries.size();
  }
  int first = 0, twenty = 0;
  for (int q = 0; q < 200; ++q) {
    const auto ranking = file.Rank(file.tree().Quantise(queries[q], paths), 20, paths);
    for (std::size_t i = 0; i < ranking.size(); ++i) {
      if (ranking[i].object != q * 7919 % objects) continue;
      first += i == 0;
      ++twenty;
    }
  }
  state.counters["leaves"] = file.tree().leaves();
  state.counters["first_right"] = first / 200.0;
  state.counters["in_first_20"] = twenty / 200.0;
  state.counters["insert_ms"] = filled.MeanInsertMs();
  state.counters["largest_leaf"] = file.LargestLeaf();
  state.counters["memory_MB"] = static_cast<double>(file.memory_bytes() + file.tree().memory_bytes()) / 1e6;
}
BENCHMARK(Query)
    ->ArgNames({"views", "leaf_points", "paths"})
    ->Args({1000, 0, 1})
    ->Args({1000, 0, 3})
    ->Args({1000, 200, 1})
    ->Args({1000, 50, 1})
    ->Args({100000, 0, 1})
    ->Args({100000, 200, 1})
    ->Unit(benchmark::kMillisecond);

// The longest pause that adding a view makes. Filling is the same every time, so what a view took in the fastest of a few fillings
// is its own: on a shared machine even a loop of 3 ms that does nothing else is seen to take 70 now and then. One of 100 000 views
// takes minutes and is done once: its longest is at most what is told.
void LongestAddition(benchmark::State& state) {
  FilledFile(1, 0);  // Lets go of what other benchmarks kept.
  const int objects = static_cast<int>(state.range(0)) / kViewsPerObject;
  std::vector<double> least;
  for (auto _ : state) {
    const std::vector<double> ms = Fill(objects, static_cast<int>(state.range(1))).insert_ms;
    if (least.empty()) least = ms;
    for (std::size_t i = 0; i < ms.size(); ++i) least[i] = std::min(least[i], ms[i]);
  }
  std::sort(least.begin(), least.end());
  state.counters["mean_ms"] = std::accumulate(least.begin(), least.end(), 0.0) / static_cast<double>(least.size());
  state.counters["p999_ms"] = least[least.size() * 999 / 1000];
  state.counters["longest_ms"] = least.back();
}
BENCHMARK(LongestAddition)
    ->ArgNames({"views", "leaf_points"})
    ->Args({1000, 0})
    ->Args({1000, 50})
    ->Iterations(3)
    ->Unit(benchmark::kSecond);
BENCHMARK(LongestAddition)->ArgNames({"views", "leaf_points"})->Args({100000, 200})->Iterations(1)->Unit(benchmark::kSecond);

// The same question by brute force: every query point votes for the object of the stored point nearest to it.
void BruteForce(benchmark::State& state) {
  const int objects = static_cast<int>(state.range(0)) / kViewsPerObject;
  cv::Mat stored;
  for (int object = 0; object < objects; ++object) {
    for (int view = 0; view < kViewsPerObject; ++view) stored.push_back(LearnedView(object, view));
  }
  int first = 0, asked = 0;
  for (auto _ : state) {
    const int object = asked * 7919 % objects;
    const auto nearest = features::NearestTwo(QueryView(object, static_cast<std::uint32_t>(asked)), stored);
    std::vector<int> votes(objects, 0);
    for (const auto& pair : nearest) ++votes[pair.best / (kViewsPerObject * kViewPoints)];
    first += std::max_element(votes.begin(), votes.end()) - votes.begin() == object;
    ++asked;
  }
  state.counters["first_right"] = static_cast<double>(first) / asked;
}
BENCHMARK(BruteForce)->ArgName("views")->Arg(1000)->Iterations(50)->Unit(benchmark::kMillisecond);

// What was added last to the tentative matches: the nearest stored points in the visited leaves, and how many of them are the
// nearest of all.
void Matches(benchmark::State& state) {
  const int paths = static_cast<int>(state.range(0));
  const InvertedFile& file = FilledFile(100, 200).file;
  const cv::Mat query = QueryView(42, 3), points = ObjectPoints(42);
  const int first = static_cast<int>(3.5 / kViewsPerObject * kObjectPoints);
  std::vector<std::vector<recognition::Neighbour>> nearest;
  for (auto _ : state) nearest = file.Nearest(query, file.tree().Quantise(query, paths), 10);
  int right = 0;
  for (int r = 0; r < query.rows; ++r) {
    if (nearest[r].empty()) continue;
    const auto& best = nearest[r][0];
    const int point =
        (static_cast<int>(static_cast<double>(best.view) / kViewsPerObject * kObjectPoints) + best.keypoint) % kObjectPoints;
    right += best.object == 42 && point == (first + r) % kObjectPoints;
  }
  state.counters["right"] = right / static_cast<double>(query.rows);
}
BENCHMARK(Matches)->ArgName("paths")->Arg(1)->Arg(4)->Arg(8)->Arg(16)->Unit(benchmark::kMillisecond);

double ResidentMB() {
  std::ifstream stream("/proc/self/statm");
  long all = 0, resident = 0;
  stream >> all >> resident;
  return static_cast<double>(resident) * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

// A million leaves: training, and the file.
void MillionLeaves(benchmark::State& state) {
  FilledFile(1, 0);  // Lets go of what other benchmarks kept.
  const double before_MB = ResidentMB();
  cv::Mat rows(5000000, kLength, CV_32F);
  for (int start = 0; start < rows.rows; start += 10000) {
    Descriptors(10000, static_cast<std::uint32_t>(start)).copyTo(rows.rowRange(start, start + 10000));
  }
  const std::filesystem::path file = std::filesystem::temp_directory_path() / ("vantage_million_" + std::to_string(getpid()));
  for (auto _ : state) {
    double start = Now();
    VocabularyTree tree = VocabularyTree::Train("made up", rows, Branching(16, 5));
    state.counters["train_s"] = Now() - start;
    state.counters["training_MB"] = ResidentMB() - before_MB;
    rows.release();
    start = Now();
    tree.Save(file);
    state.counters["save_s"] = Now() - start;
    state.counters["file_MB"] = static_cast<double>(std::filesystem::file_size(file)) / 1e6;
    start = Now();
    const VocabularyTree loaded = VocabularyTree::Load(file, "made up", kLength);
    state.counters["load_s"] = Now() - start;
    state.counters["leaves"] = loaded.leaves();
    state.counters["tree_MB"] = static_cast<double>(loaded.memory_bytes()) / 1e6;
    const cv::Mat query = QueryView(1, 1);
    start = Now();
    for (int i = 0; i < 100; ++i) benchmark::DoNotOptimize(loaded.Quantise(query));
    state.counters["quantise_ms"] = 10.0 * (Now() - start);
  }
  std::filesystem::remove(file);
}
BENCHMARK(MillionLeaves)->Iterations(1)->Unit(benchmark::kSecond);

}  // namespace
