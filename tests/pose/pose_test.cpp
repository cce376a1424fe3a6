#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <array>
#include <cmath>
#include <random>
#include <utility>

#include "pose/dense.h"
#include "pose/p3p.h"
#include "pose/ransac.h"
#include "pose/refine.h"
#include "pose/support.h"

namespace vantage::pose {
namespace {

TEST(Quartic, FindsTheRootsOfKnownPolynomials) {
  std::array<double, 4> roots;
  ASSERT_EQ(SolveQuartic(-10, 35, -50, 24, &roots), 4);  // (x-1)(x-2)(x-3)(x-4)
  std::sort(roots.begin(), roots.end());
  for (int i = 0; i < 4; ++i) EXPECT_NEAR(roots[i], i + 1, 1e-9);
  EXPECT_EQ(SolveQuartic(0, 0, 0, 1, &roots), 0);   // x^4 = -1
  ASSERT_EQ(SolveQuartic(0, -5, 0, 4, &roots), 4);  // Biquadratic: +-1, +-2
}

TEST(P3p, OneOfTheSolutionsIsTheTruth) {
  Truth truth(1);
  int found = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    const geometry::Rigid T = truth.Pose();
    Eigen::Matrix3d points, rays;
    for (int k = 0; k < 3; ++k) {
      points.col(k) = truth.Point(0.1);
      rays.col(k) = (T * Eigen::Vector3d(points.col(k))).normalized();
    }
    const P3pSolutions solutions = SolveP3p(rays, points);
    bool hit = false;
    for (int s = 0; s < solutions.count; ++s) hit |= geometry::Difference(solutions.T_camera_object[s], T).translation_m < 1e-5;
    found += hit;
  }
  EXPECT_GE(found, 995);
}

TEST(P3p, CollinearPointsHaveNoPose) {
  Eigen::Matrix3d points;
  points << 0, 1, 2, 0, 1, 2, 0, 1, 2;
  EXPECT_EQ(SolveP3p(Eigen::Matrix3d::Identity(), points).count, 0);
}

TEST(Ransac, FindsThePoseAmongOutliers) {
  for (const double share : {0.5, 0.3, 0.1}) {
    int right = 0;
    for (std::uint32_t seed = 0; seed < 20; ++seed) {
      Truth truth(seed);
      const geometry::Rigid T = truth.Pose();
      const auto matches = truth.Matches(T, 200, share, 1.0);
      const auto estimate = EstimatePose(matches, kCamera, nullptr, RansacParams{}, seed);
      right += estimate && geometry::Difference(estimate->T_camera_object, T).translation_m < 0.02;
    }
    EXPECT_EQ(right, 20) << "share of inliers " << share;
  }
}

TEST(Ransac, IsTheSameForTheSameSeed) {
  Truth truth(7);
  const auto matches = truth.Matches(truth.Pose(), 100, 0.4, 1.0);
  const auto a = EstimatePose(matches, kCamera, nullptr, RansacParams{}, 3);
  const auto b = EstimatePose(matches, kCamera, nullptr, RansacParams{}, 3);
  ASSERT_TRUE(a && b);
  EXPECT_EQ(a->T_camera_object.matrix(), b->T_camera_object.matrix());
  EXPECT_EQ(a->inliers, b->inliers);
}

TEST(Ransac, TheDepthImagePrunesPosesInFrontOfAndBehindTheSurface) {
  Truth truth(5);
  geometry::Rigid T = truth.Pose();
  const auto matches = truth.Matches(T, 100, 1.0, 0.5);
  rgbd::Frame frame;
  frame.camera = kCamera;
  for (const int wrong_mm : {-200, 200}) {
    frame.depth = cv::Mat::zeros(480, 640, CV_16UC1);
    for (const Match2d3d& match : matches) {
      const int depth_mm = static_cast<int>((T * match.point).z() * 1000) + wrong_mm;
      frame.depth(cv::Rect(match.pixel.x() - 3, match.pixel.y() - 3, 7, 7) & cv::Rect(0, 0, 640, 480)).setTo(depth_mm);
    }
    EXPECT_FALSE(EstimatePose(matches, kCamera, &frame, RansacParams{}, 1).has_value()) << wrong_mm;
  }
}

TEST(Ransac, TooFewMatchesIsNoPose) {
  Truth truth(2);
  EXPECT_FALSE(EstimatePose(truth.Matches(truth.Pose(), 3, 1.0, 0.0), kCamera, nullptr, RansacParams{}, 0).has_value());
  EXPECT_FALSE(EstimatePose({}, kCamera, nullptr, RansacParams{}, 0).has_value());
  RansacParams params;
  params.max_iterations = 10;
  EXPECT_THROW(params.Check(), std::invalid_argument);
}

TEST(Refine, ConvergesFromNearBy) {
  Truth truth(9);
  const geometry::Rigid T = truth.Pose();
  const auto matches = truth.Matches(T, 60, 1.0, 0.0);
  std::vector<int> all(matches.size());
  for (size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int>(i);
  geometry::Rigid start = T;
  start.translation() += Eigen::Vector3d(0.01, -0.01, 0.02);
  start.rotate(Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitX()));
  EXPECT_LT(geometry::Difference(RefinePose(matches, all, kCamera, start, 3.0, 20), T).translation_m, 1e-6);
}

// A corner of three planes fills the image; a single plane tells three directions only.
TEST(Refine, ASurfaceFindsThePoseAndSaysWhatItDoesNotKnow) {
  rgbd::Frame frame;
  frame.camera = {160, 120, 130, 130, 79.5, 59.5};
  for (const bool corner : {true, false}) {
    frame.depth = cv::Mat::zeros(120, 160, CV_16UC1);
    std::vector<SurfacePoint> surface;  // In camera coordinates: the true pose is the identity.
    const std::vector<Eigen::Vector3d> normals =
        corner ? std::vector<Eigen::Vector3d>{{0.5, 0.2, -0.8}, {-0.6, 0.1, -0.8}, {0.1, -0.7, -0.7}}
               : std::vector<Eigen::Vector3d>{{0.2, 0.1, -0.9}};
    for (int y = 0; y < 120; ++y) {
      for (int x = 0; x < 160; ++x) {
        const Eigen::Vector3d ray = frame.camera.Unproject({x, y}, 1.0);
        double nearest = 0.0;  // A convex corner at 0.5 m: the farthest of its planes that faces the ray.
        Eigen::Vector3d facing = Eigen::Vector3d::Zero();
        for (const Eigen::Vector3d& n : normals) {
          const double depth = n.normalized().dot(Eigen::Vector3d(0, 0, 0.5)) / n.normalized().dot(ray);
          if (depth > nearest) {
            nearest = depth;
            facing = n.normalized();
          }
        }
        if (nearest <= 0.0 || nearest > 2.0) continue;
        frame.depth.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(std::lround(1000 * nearest));
        if (x % 8 == 0 && y % 8 == 0) surface.push_back({nearest * ray, facing});
      }
    }
    geometry::Rigid start = geometry::Rigid::Identity();
    start.translation() = Eigen::Vector3d(0.004, -0.003, 0.005);
    start.rotate(Eigen::AngleAxisd(0.01, Eigen::Vector3d(0.3, 1, 0.2).normalized()));
    const DenseFit fit = FitDensely({surface, {}}, frame, nullptr, start, {});
    EXPECT_GT(fit.samples, 100);
    const Eigen::VectorXd eigenvalues = Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>>(fit.information).eigenvalues();
    const Eigen::Vector3d middle(0, 0, 0.5);
    if (corner) {
      EXPECT_LT((fit.T_camera_object * middle - middle).norm(), 0.001);
      EXPECT_GT(eigenvalues(0), 0.0);
    } else {
      EXPECT_LT(
          std::abs(normals[0].normalized().dot(fit.T_camera_object * Eigen::Vector3d(0, 0, 0.5) - Eigen::Vector3d(0, 0, 0.5))),
          0.001);
      EXPECT_LT(fit.T_camera_object.translation().norm(), 0.02);  // It has not slid away.
      EXPECT_LT(eigenvalues(2), 1e-6 * eigenvalues(5));
    }
  }
  EXPECT_EQ(FitDensely({}, frame, nullptr, geometry::Rigid::Identity(), {}).samples, 0);
}

// Monte Carlo: the spread told is the spread seen, and few points on a small flat part hold a pose badly.
TEST(SpreadOfPose, TellsHowFarEstimatesScatter) {
  const geometry::PinholeCamera camera{640, 480, 525, 525, 319.5, 239.5};
  geometry::Rigid T = geometry::Rigid::Identity();
  T.translation() = Eigen::Vector3d(0.02, -0.03, 0.7);
  T.linear() = Eigen::AngleAxisd(0.4, Eigen::Vector3d(0.2, 1, 0.1).normalized()).toRotationMatrix();
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  std::normal_distribution<double> normal(0.0, 1.0);
  const auto spread_and_scatter = [&](double width_m, double depth_m) {
    std::vector<Match2d3d> truth;
    std::vector<int> all;
    for (int i = 0; i < 60; ++i) {
      const Eigen::Vector3d point(width_m * uniform(random), 0.1 * uniform(random), depth_m * uniform(random));
      truth.push_back({*camera.Project(T * point), point, 0.0});
      all.push_back(i);
    }
    double sum_m = 0.0, sum_rad = 0.0;
    constexpr int kRuns = 200;
    for (int run = 0; run < kRuns; ++run) {
      std::vector<Match2d3d> noisy = truth;
      for (Match2d3d& match : noisy) match.pixel += Eigen::Vector2d(normal(random), normal(random));
      const geometry::PoseDifference error = geometry::Difference(RefinePose(noisy, all, camera, T, 50.0), T);
      sum_m += error.translation_m * error.translation_m;
      sum_rad += error.rotation_rad * error.rotation_rad;
    }
    return std::pair(SpreadOfPose(truth, all, camera, T, 1.0), PoseSpread{std::sqrt(sum_m / kRuns), std::sqrt(sum_rad / kRuns)});
  };
  const auto [held, held_scatter] = spread_and_scatter(0.08, 0.05);
  // The worst direction carries most of the scatter, never more than all of it.
  EXPECT_LT(held.sigma_m, 1.2 * held_scatter.sigma_m);
  EXPECT_GT(held.sigma_m, 0.6 * held_scatter.sigma_m);
  EXPECT_LT(held.sigma_rad, 1.2 * held_scatter.sigma_rad);
  EXPECT_GT(held.sigma_rad, 0.6 * held_scatter.sigma_rad);
  const auto [loose, loose_scatter] = spread_and_scatter(0.015, 0.0);
  EXPECT_GT(loose.sigma_rad, 3.0 * held.sigma_rad);
  EXPECT_GT(loose_scatter.sigma_rad, 3.0 * held_scatter.sigma_rad);
}

TEST(SpreadOfPose, IsInfiniteWhereADirectionIsOpen) {
  const geometry::PinholeCamera camera{640, 480, 525, 525, 319.5, 239.5};
  geometry::Rigid T = geometry::Rigid::Identity();
  T.translation().z() = 0.7;
  std::vector<Match2d3d> line;
  for (int i = 0; i < 10; ++i) {
    const Eigen::Vector3d point(0.01 * i, 0.0, 0.0);
    line.push_back({*camera.Project(T * point), point, 0.0});
  }
  EXPECT_FALSE(std::isfinite(SpreadOfPose(line, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9}, camera, T, 1.0).sigma_rad));
  EXPECT_FALSE(std::isfinite(SpreadOfPose(line, {0, 1}, camera, T, 1.0).sigma_m));
}

}  // namespace
}  // namespace vantage::pose
