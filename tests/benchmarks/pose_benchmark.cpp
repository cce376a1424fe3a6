// One camera pose from 200 matches, ours beside OpenCV's P3P RANSAC on the same matches in the same run: processor time, how many
// poses were right (mean point distance below 40 mm at 0.7 m), and how many times faster ours was.
#include <benchmark/benchmark.h>

#include <Eigen/Geometry>
#include <chrono>
#include <cmath>
#include <ctime>
#include <opencv2/calib3d.hpp>
#include <random>

#include "pose/p3p.h"
#include "pose/ransac.h"

namespace {

using namespace vantage;

constexpr int kTrials = 50;
constexpr int kMatches = 200;
constexpr double kRight = 0.04;  // Metres.

const geometry::PinholeCamera kCamera{640, 480, 525, 525, 319.5, 239.5};

struct Trial {
  geometry::Rigid T_camera_object = geometry::Rigid::Identity();
  std::vector<pose::Match2d3d> matches;
};

// Points within 20 cm at 0.7 m, seen with a pixel of noise; the outliers anywhere in the image.
Trial MakeTrial(double inlier_share, std::uint32_t seed) {
  std::mt19937 random(seed);
  const auto uniform = [&](double low, double high) { return low + (high - low) * (random() / 4294967296.0); };
  const auto normal = [&] { return std::sqrt(-2.0 * std::log(uniform(1e-12, 1.0))) * std::cos(uniform(0.0, 2.0 * M_PI)); };
  Trial trial;
  trial.T_camera_object.linear() = Eigen::Quaterniond(normal(), normal(), normal(), normal()).normalized().toRotationMatrix();
  trial.T_camera_object.translation() = Eigen::Vector3d(uniform(-0.1, 0.1), uniform(-0.1, 0.1), 0.7);
  for (int i = 0; i < kMatches; ++i) {
    const Eigen::Vector3d point(uniform(-0.1, 0.1), uniform(-0.1, 0.1), uniform(-0.1, 0.1));
    Eigen::Vector2d pixel = *kCamera.Project(trial.T_camera_object * point) + Eigen::Vector2d(normal(), normal());
    if (i >= inlier_share * kMatches) pixel = {uniform(0, 640), uniform(0, 480)};
    trial.matches.push_back({pixel, point});
  }
  return trial;
}

std::vector<Trial> MakeTrials(double inlier_share) {
  std::vector<Trial> trials;
  for (int seed = 0; seed < kTrials; ++seed) trials.push_back(MakeTrial(inlier_share, 1000 + seed));
  return trials;
}

bool IsRight(const Trial& trial, const geometry::Rigid& T_camera_object) {
  double sum = 0.0;
  for (const pose::Match2d3d& match : trial.matches) {
    sum += (T_camera_object * match.point - trial.T_camera_object * match.point).norm();
  }
  return sum < kRight * trial.matches.size();
}

bool ByOpenCv(const Trial& trial, int seed) {
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> pixels;
  for (const pose::Match2d3d& match : trial.matches) {
    points.emplace_back(match.point.x(), match.point.y(), match.point.z());
    pixels.emplace_back(match.pixel.x(), match.pixel.y());
  }
  const cv::Matx33d K(kCamera.fx, 0, kCamera.cx, 0, kCamera.fy, kCamera.cy, 0, 0, 1);
  cv::Mat rotation, translation, R, inliers;
  cv::theRNG().state = seed;
  if (!cv::solvePnPRansac(points, pixels, K, cv::noArray(), rotation, translation, false, 10000, 3.0f, 0.99, inliers,
                          cv::SOLVEPNP_P3P)) {
    return false;
  }
  cv::Rodrigues(rotation, R);
  geometry::Rigid T = geometry::Rigid::Identity();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) T.linear()(row, column) = R.at<double>(row, column);
    T.translation()(row) = translation.at<double>(row);
  }
  return IsRight(trial, T);
}

bool ByOurs(const Trial& trial, int seed) {
  const auto estimate = pose::EstimatePose(trial.matches, kCamera, nullptr, pose::RansacParams{}, seed);
  return estimate && IsRight(trial, estimate->T_camera_object);
}

double ThreadSeconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return now.tv_sec + 1e-9 * now.tv_nsec;
}

struct Total {
  int right = 0;
  double seconds = 0.0;
  double slowest = 0.0;
};

template <typename Solve>
void Time(const Solve& solve, const Trial& trial, int seed, Total* total) {
  const double start = ThreadSeconds();
  total->right += solve(trial, seed);
  const double seconds = ThreadSeconds() - start;
  total->seconds += seconds;
  total->slowest = std::max(total->slowest, seconds);
}

// Argument: inliers in percent.
void PoseOf200Matches(benchmark::State& state) {
  const std::vector<Trial> trials = MakeTrials(state.range(0) / 100.0);
  Total ours;
  for (auto _ : state) {
    ours = Total();
    for (int i = 0; i < kTrials; ++i) Time(ByOurs, trials[i], i, &ours);
  }
  state.counters["right_of_50"] = ours.right;
  state.counters["ms"] = 1000.0 * ours.seconds / kTrials;
  state.counters["ms_slowest"] = 1000.0 * ours.slowest;
}
BENCHMARK(PoseOf200Matches)->Arg(50)->Arg(30)->Arg(10)->Unit(benchmark::kMillisecond);

// Argument: inliers in percent.
void BesideOpenCv(benchmark::State& state) {
  const std::vector<Trial> trials = MakeTrials(state.range(0) / 100.0);
  cv::setNumThreads(1);
  Total ours, theirs;
  for (auto _ : state) {
    ours = theirs = Total();
    for (int i = 0; i < kTrials; ++i) {
      Time(ByOurs, trials[i], i, &ours);
      Time(ByOpenCv, trials[i], i, &theirs);
    }
  }
  state.counters["ours_right_of_50"] = ours.right;
  state.counters["ours_ms"] = 1000.0 * ours.seconds / kTrials;
  state.counters["opencv_right_of_50"] = theirs.right;
  state.counters["opencv_ms"] = 1000.0 * theirs.seconds / kTrials;
  state.counters["times_faster"] = theirs.seconds / ours.seconds;
}
BENCHMARK(BesideOpenCv)->Arg(30)->Iterations(3)->Unit(benchmark::kMillisecond);

void P3p(benchmark::State& state) {
  const Trial trial = MakeTrial(1.0, 1);
  int i = 0;
  for (auto _ : state) {
    Eigen::Matrix3d rays, points;
    for (int k = 0; k < 3; ++k) {
      const pose::Match2d3d& match = trial.matches[(i + 7 * k) % kMatches];
      rays.col(k) = kCamera.Unproject(match.pixel, 1.0).normalized();
      points.col(k) = match.point;
    }
    ++i;
    benchmark::DoNotOptimize(pose::SolveP3p(rays, points));
  }
}
BENCHMARK(P3p);

}  // namespace
