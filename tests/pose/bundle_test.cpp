#include "pose/bundle.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iostream>
#include <limits>
#include <random>

namespace vantage::pose {
namespace {

const geometry::PinholeCamera kCamera{640, 480, 525, 525, 319.5, 239.5};

class Random {
 public:
  explicit Random(std::uint32_t seed) : random_(seed) {}
  double Uniform(double low, double high) { return low + (high - low) * (random_() / 4294967296.0); }
  double Normal() { return std::sqrt(-2.0 * std::log(Uniform(1e-12, 1.0))) * std::cos(Uniform(0.0, 2.0 * M_PI)); }
  Eigen::Vector3d Normal3() { return {Normal(), Normal(), Normal()}; }

 private:
  std::mt19937 random_;
};

geometry::Rigid OrbitPose(double azimuth_rad) {
  const Eigen::Vector3d eye(0.6 * std::cos(azimuth_rad), 0.6 * std::sin(azimuth_rad), 0.35);
  return geometry::LookAt(eye, Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ()).inverse();
}

struct OrbitOptions {
  int views = 36;
  int points = 2000;
  double noise_px = 0.5;
  double outliers = 0.1;
  bool with_depth = true;
  bool closed = true;  // Whether the last views' points are the first ones' again; if not they are points of their own.
  std::uint32_t seed = 1;
};

// Once round a cylinder of 8 cm radius. A view sees the side facing it.
struct Orbit {
  BundleProblem truth;
  BundleProblem start;

  explicit Orbit(const OrbitOptions& options) {
    Random random(options.seed);
    for (int v = 0; v < options.views; ++v) truth.views.push_back({OrbitPose(2 * M_PI * v / options.views), kCamera, v == 0, {}});
    for (int p = 0; p < options.points; ++p) AddPoint(&random, options);
    start = truth;
    for (BundleObservation& o : start.observations) Disturb(&random, options, &o);
    Drift(&random, options);
  }

  double ErrorOfView(const BundleProblem& problem, int view) const {
    return geometry::Difference(problem.views[view].T_camera_object, truth.views[view].T_camera_object).translation_m;
  }
  double TurnOfView(const BundleProblem& problem, int view) const {
    return geometry::Difference(problem.views[view].T_camera_object, truth.views[view].T_camera_object).rotation_rad * 180 / M_PI;
  }
  double WorstView(const BundleProblem& problem) const {
    double worst = 0.0;
    for (size_t v = 0; v < truth.views.size(); ++v) worst = std::max(worst, ErrorOfView(problem, static_cast<int>(v)));
    return worst;
  }
  double MedianPoint(const BundleProblem& problem) const {
    std::vector<double> errors;
    for (size_t p = 0; p < truth.points.size(); ++p) errors.push_back((problem.points[p] - truth.points[p]).norm());
    std::nth_element(errors.begin(), errors.begin() + errors.size() / 2, errors.end());
    return errors[errors.size() / 2];
  }

 private:
  void AddPoint(Random* random, const OrbitOptions& options) {
    const double azimuth = random->Uniform(0.0, 2 * M_PI);
    const Eigen::Vector3d position(0.08 * std::cos(azimuth), 0.08 * std::sin(azimuth), random->Uniform(-0.1, 0.1));
    const int index = static_cast<int>(truth.points.size());
    int twin = -1;
    for (int v = 0; v < options.views; ++v) {
      const double away = std::remainder(2 * M_PI * v / options.views - azimuth, 2 * M_PI);
      if (std::abs(away) > 0.5 || random->Uniform(0, 1) < 0.3) continue;
      int seen_as = index;
      const bool at_seam = std::abs(std::remainder(azimuth, 2 * M_PI)) < 0.6;
      if (!options.closed && v > options.views / 2 && at_seam) seen_as = twin < 0 ? twin = index + 1 : twin;
      const Eigen::Vector3d p = truth.views[v].T_camera_object * position;
      truth.observations.push_back({v, seen_as, *kCamera.Project(p), options.with_depth ? p.z() : 0.0});
    }
    truth.points.push_back(position);
    if (twin >= 0) truth.points.push_back(position);
  }

  static void Disturb(Random* random, const OrbitOptions& options, BundleObservation* o) {
    o->pixel += options.noise_px * Eigen::Vector2d(random->Normal(), random->Normal());
    if (o->depth_m > 0.0) o->depth_m += (0.0012 + 0.0019 * std::pow(o->depth_m - 0.4, 2)) * random->Normal();
    if (random->Uniform(0, 1) >= options.outliers) return;
    o->pixel += Eigen::Vector2d(random->Uniform(-60, 60), random->Uniform(-60, 60));
    if (o->depth_m > 0.0) o->depth_m += random->Uniform(-0.05, 0.05);
  }

  // Every view errs a little more in the same direction; points stand where the first view that saw them put them.
  void Drift(Random* random, const OrbitOptions& options) {
    geometry::Rigid drift = geometry::Rigid::Identity();
    for (int v = 1; v < options.views; ++v) {
      geometry::Rigid step = geometry::Rigid::Identity();
      step.translation() = Eigen::Vector3d(0.0008, 0.0004, 0.0005) + 0.0005 * random->Normal3();
      step.rotate(Eigen::AngleAxisd(0.003 + 0.001 * random->Normal(), Eigen::Vector3d(0.3, 0.2, 0.9).normalized()));
      drift = drift * step;
      start.views[v].T_camera_object = truth.views[v].T_camera_object * drift;
    }
    std::vector<bool> placed(truth.points.size(), false);
    for (const BundleObservation& o : truth.observations) {
      if (placed[o.point]) continue;
      placed[o.point] = true;
      const Eigen::Vector3d noise = 0.002 * random->Normal3();
      start.points[o.point] =
          start.views[o.view].T_camera_object.inverse() * (truth.views[o.view].T_camera_object * truth.points[o.point] + noise);
    }
  }
};

TEST(Bundle, AClosedOrbitLosesItsDriftInSpiteOfOutliers) {
  for (std::uint32_t seed = 1; seed <= 3; ++seed) {
    OrbitOptions options;
    options.seed = seed;
    const Orbit orbit(options);
    ASSERT_GT(orbit.WorstView(orbit.start), 0.02) << "seed " << seed;
    BundleProblem problem = orbit.start;
    const BundleReport report = AdjustBundle(&problem, BundleParams{});
    EXPECT_TRUE(report.converged) << "seed " << seed;
    EXPECT_LT(report.final_cost, report.initial_cost);
    EXPECT_LT(orbit.ErrorOfView(problem, options.views - 1), 0.003) << "seed " << seed;
    EXPECT_LT(orbit.TurnOfView(problem, options.views - 1), 0.7) << "seed " << seed;
    EXPECT_LT(orbit.WorstView(problem), 0.003) << "seed " << seed;
    EXPECT_LT(orbit.MedianPoint(problem), 0.002) << "seed " << seed;
    EXPECT_NEAR(report.final_rms_px, 0.6, 0.15);  // 0.5 px in each direction.
    EXPECT_NEAR(report.inlier_share, 0.9, 0.03);
  }
}

TEST(Bundle, WithoutAClosureTheDriftStays) {
  OrbitOptions options;
  options.closed = false;
  const Orbit orbit(options);
  BundleProblem problem = orbit.start;
  AdjustBundle(&problem, BundleParams{});
  OrbitOptions closed_options;
  const Orbit closed(closed_options);
  BundleProblem closed_problem = closed.start;
  AdjustBundle(&closed_problem, BundleParams{});
  EXPECT_LT(closed.ErrorOfView(closed_problem, 35), 0.5 * orbit.ErrorOfView(problem, 35));
}

TEST(Bundle, WorksWithoutDepth) {
  OrbitOptions options;
  options.with_depth = false;
  options.outliers = 0.05;
  const Orbit orbit(options);
  BundleProblem problem = orbit.start;
  problem.views[1].fixed = true;  // The scale is what two known poses say.
  problem.views[1].T_camera_object = orbit.truth.views[1].T_camera_object;
  problem.views[2].fixed = true;
  problem.views[2].T_camera_object = orbit.truth.views[2].T_camera_object;
  const BundleReport report = AdjustBundle(&problem, BundleParams{});
  EXPECT_EQ(report.final_rms_depth_m, 0.0);
  EXPECT_LT(orbit.ErrorOfView(problem, options.views - 1), 0.2 * orbit.ErrorOfView(orbit.start, options.views - 1));
  EXPECT_LT(orbit.WorstView(problem), 0.7 * orbit.WorstView(orbit.start));  // The far side is held loosely.
}

TEST(Bundle, FixedViewsStayAndTheResultIsTheSameEveryTime) {
  const Orbit orbit(OrbitOptions{});
  BundleProblem a = orbit.start;
  for (int v = 0; v < 30; ++v) a.views[v].fixed = true;
  BundleProblem b = a;
  const BundleReport report = AdjustBundle(&a, BundleParams{});
  AdjustBundle(&b, BundleParams{});
  EXPECT_EQ(report.views, 6);
  EXPECT_LT(report.points, 1200);
  for (int v = 0; v < 30; ++v) {
    EXPECT_EQ(a.views[v].T_camera_object.matrix(), orbit.start.views[v].T_camera_object.matrix());
  }
  for (size_t v = 0; v < a.views.size(); ++v) {
    EXPECT_EQ(a.views[v].T_camera_object.matrix(), b.views[v].T_camera_object.matrix());
  }
  for (size_t p = 0; p < a.points.size(); ++p) EXPECT_EQ(a.points[p], b.points[p]);
}

TEST(Bundle, APriorHoldsAViewThatSeesLittle) {
  OrbitOptions options;
  options.outliers = 0.0;
  Orbit orbit(options);
  BundleProblem problem = orbit.start;
  problem.observations.erase(std::remove_if(problem.observations.begin(), problem.observations.end(),
                                            [](const BundleObservation& o) { return o.view == 20; }),
                             problem.observations.end());
  problem.views[20].prior = PosePrior{orbit.truth.views[20].T_camera_object, 0.003, 0.005};
  AdjustBundle(&problem, BundleParams{});
  EXPECT_LT(orbit.ErrorOfView(problem, 20), 1e-4);
  EXPECT_LT(orbit.WorstView(problem), 0.003);
}

TEST(Bundle, ARelationPlacesAViewInTheDirectionsItKnows) {
  OrbitOptions options;
  options.outliers = 0.0;
  const Orbit orbit(options);
  BundleProblem problem = orbit.start;
  problem.observations.erase(std::remove_if(problem.observations.begin(), problem.observations.end(),
                                            [](const BundleObservation& o) { return o.view == 20; }),
                             problem.observations.end());
  const geometry::Rigid T_b_a = orbit.truth.views[20].T_camera_object * orbit.truth.views[19].T_camera_object.inverse();
  BundleRelation relation{19, 20, T_b_a, 1e6 * Matrix6d::Identity()};
  const auto relative_error = [&](const BundleProblem& p) {
    return geometry::Difference(p.views[20].T_camera_object * p.views[19].T_camera_object.inverse(), T_b_a);
  };
  BundleProblem known = problem;
  known.relations = {relation};
  AdjustBundle(&known, BundleParams{});
  EXPECT_LT(relative_error(known).translation_m, 1e-4);
  EXPECT_LT(relative_error(known).rotation_rad, 1e-4);
  EXPECT_LT(orbit.ErrorOfView(known, 20), 0.003);

  // Known in depth alone, the rest stays about where it was.
  relation.information = 1e-2 * Matrix6d::Identity();
  relation.information(2, 2) = 1e6;
  BundleProblem depth_only = problem;
  depth_only.relations = {relation};
  for (BundleView& view : depth_only.views) view.fixed = true;
  depth_only.views[20].fixed = false;
  AdjustBundle(&depth_only, BundleParams{});
  const geometry::Rigid moved = depth_only.views[20].T_camera_object * problem.views[20].T_camera_object.inverse();
  EXPECT_GT(std::abs(moved.translation().z()), 1e-5);
  const geometry::Rigid left =
      depth_only.views[20].T_camera_object * depth_only.views[19].T_camera_object.inverse() * T_b_a.inverse();
  EXPECT_LT(std::abs(left.translation().z()), 1e-4);

  BundleProblem bad = problem;  // Broken ones are left out.
  bad.relations = {relation, relation, relation};
  bad.relations[0].view_a = 99;
  bad.relations[1].view_b = 19;
  bad.relations[2].information(0, 0) = std::numeric_limits<double>::quiet_NaN();
  AdjustBundle(&bad, BundleParams{});
  EXPECT_EQ(bad.views[20].T_camera_object.matrix(), problem.views[20].T_camera_object.matrix());
}

TEST(Bundle, TheWholeOrbitTakesLessThanASecond) {
  const Orbit orbit(OrbitOptions{40, 3800, 0.5, 0.1, true, true, 1});
  BundleProblem problem = orbit.start;
  const auto start = std::chrono::steady_clock::now();
  const BundleReport report = AdjustBundle(&problem, BundleParams{});
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::cout << report.observations << " observations, " << report.points << " points, " << report.iterations
            << " iterations: " << seconds << " s\n";
  RecordProperty("seconds", std::to_string(seconds));
  EXPECT_LT(seconds, 5.0);  // On a busy machine; alone about 0.4 s.
}

TEST(Bundle, DegenerateProblemsChangeNothingAndNeverCrash) {
  BundleProblem empty;
  EXPECT_TRUE(AdjustBundle(&empty, BundleParams{}).converged);

  OrbitOptions options;
  options.views = 3;
  options.points = 300;
  BundleProblem problem = Orbit(options).start;
  const BundleProblem kept = problem;
  for (BundleView& view : problem.views) view.fixed = true;
  EXPECT_EQ(AdjustBundle(&problem, BundleParams{}).points, 0);
  for (size_t p = 0; p < problem.points.size(); ++p) EXPECT_EQ(problem.points[p], kept.points[p]);

  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinite = std::numeric_limits<double>::infinity();
  problem = kept;
  problem.points[0] = {nan, 0, 0};
  problem.points[1] = {0, infinite, 0};
  problem.points[2] = {10, 0, 5};  // Behind some of the cameras.
  problem.observations[5].pixel.x() = nan;
  problem.observations[6].depth_m = nan;
  problem.observations[7].depth_m = -1.0;
  problem.observations.push_back({99, 0, {1, 1}, 0.5});
  problem.observations.push_back({0, -1, {1, 1}, 0.5});
  problem.views[2].T_camera_object.translation().z() = -5.0;  // All of its points are behind it.
  AdjustBundle(&problem, BundleParams{});
  for (size_t p = 3; p < problem.points.size(); ++p) EXPECT_TRUE(problem.points[p].allFinite());
  for (const BundleView& view : problem.views) EXPECT_TRUE(view.T_camera_object.matrix().allFinite());

  problem = kept;
  problem.views[1].T_camera_object.translation().x() = nan;
  AdjustBundle(&problem, BundleParams{});
  EXPECT_TRUE(problem.views[2].T_camera_object.matrix().allFinite());

  problem = kept;  // A single point seen by all, then a single view.
  for (BundleObservation& o : problem.observations) o.point = 0;
  AdjustBundle(&problem, BundleParams{});
  EXPECT_TRUE(problem.points[0].allFinite());
  problem = kept;
  for (BundleObservation& o : problem.observations) o.view = 0;
  EXPECT_EQ(AdjustBundle(&problem, BundleParams{}).observations, 0);
}

TEST(Bundle, ParametersOutOfRangeAreNamed) {
  BundleParams params;
  params.depth_noise.base_m = 0.0;
  BundleProblem problem;
  try {
    AdjustBundle(&problem, params);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("base_m"), std::string::npos);
  }
}

}  // namespace
}  // namespace vantage::pose
