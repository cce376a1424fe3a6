#include "simulation/orbit.h"

#include <gtest/gtest.h>

#include <set>

#include "simulation/orbit_sequence.h"
#include "simulation/small_world.h"

namespace vantage::simulation {
namespace {

constexpr double kDeg = M_PI / 180.0;

TEST(Orbit, CirclesTheMiddleAtTheElevationsAsked) {
  OrbitParams params;
  params.jitter_m = params.jitter_deg = 0.0;
  const Eigen::Vector3d middle(0.1, 0.2, 0.3);
  const OrbitPath path(params, middle);
  for (int circle = 0; circle < path.circles(); ++circle) {
    const double closes_s = path.ClosesAt_s(circle), opens_s = closes_s - 360.0 / params.turn_deg_s;
    for (double t = opens_s; t <= closes_s; t += 0.5) {
      const geometry::Rigid T = path.PoseAt(t);
      const Eigen::Vector3d from = T.translation() - middle;
      EXPECT_NEAR(from.norm(), 0.7, 1e-9);
      EXPECT_NEAR(std::asin(from.z() / from.norm()), params.elevations_deg[circle] * kDeg, 1e-9);
      EXPECT_NEAR(geometry::AngleBetween(T.linear().col(2), -from), 0.0, 1e-6);
    }
    EXPECT_LT(geometry::Difference(path.PoseAt(opens_s), path.PoseAt(closes_s)).translation_m, 1e-9);
  }
  EXPECT_NEAR(path.duration_s(), 2 * 375.0 / 30.0 + 1.0, 1e-9);
}

TEST(Orbit, JitterIsOfTheSizeAskedAndOfTheSeed) {
  OrbitParams params, still;
  params.jitter_m = 0.004;
  params.jitter_deg = 0.5;
  still.jitter_m = still.jitter_deg = 0.0;
  const OrbitPath path(params, {0, 0, 0}), same(params, {0, 0, 0}), calm(still, {0, 0, 0});
  params.seed = 5;
  const OrbitPath other(params, {0, 0, 0});
  double translation = 0.0, rotation = 0.0, differs = 0.0;
  int count = 0;
  for (double t = 0.0; t < 20.0; t += 0.05, ++count) {
    const geometry::PoseDifference d = geometry::Difference(path.PoseAt(t), calm.PoseAt(t));
    translation += d.translation_m * d.translation_m;
    rotation += d.rotation_rad * d.rotation_rad;
    differs += geometry::Difference(path.PoseAt(t), other.PoseAt(t)).translation_m;
    EXPECT_EQ(path.PoseAt(t).matrix(), same.PoseAt(t).matrix());
  }
  EXPECT_NEAR(std::sqrt(translation / count), std::sqrt(3.0) * 0.004, 0.001);
  EXPECT_NEAR(std::sqrt(rotation / count), std::sqrt(3.0) * 0.5 * kDeg, 0.25 * kDeg);
  EXPECT_GT(differs / count, 0.002);
}

// What the twist says of a point's motion in the image is what projecting it from the moved camera gives.
TEST(Orbit, TwistMovesTheImageAsTheCameraDoes) {
  const geometry::PinholeCamera camera{640, 480, 525, 525, 319.5, 239.5};
  const OrbitPath path(OrbitParams{}, {0, 0, 0.1});
  constexpr double kStep_s = 1e-4;
  for (const double t : {0.3, 4.0, 12.7}) {
    const geometry::Rigid T = path.PoseAt(t), T_later = path.PoseAt(t + kStep_s);
    for (const Eigen::Vector2d& pixel : {Eigen::Vector2d(100, 50), {320, 240}, {600, 400}}) {
      for (const double depth_m : {0.5, 2.0}) {
        const Eigen::Vector3d point = T * camera.Unproject(pixel, depth_m);
        const Eigen::Vector2d moved = (*camera.Project(T_later.inverse() * point) - pixel) / kStep_s;
        EXPECT_LT((ImageMotion(camera, pixel, 1.0 / depth_m, path.TwistAt(t)) - moved).norm(), 0.02 * moved.norm() + 0.1);
      }
    }
  }
}

class Sequence : public ::testing::Test {
 protected:
  Sequence() : world_(Room(pictures_)) {
    params_.rate_hz = 5.0;
    params_.orbit.elevations_deg = {40.0};
    params_.fault.start_s = 2.0;
  }

  static WorldParams Room(const testing::PictureFolder& pictures) {
    WorldParams room = pictures.World({{{0.08, 0.1, 0.15}, {0, 0, 0}}, {{0.1, 0.08, 0.12}, {0.3, 0.1, 0}}});
    room.sensor.width = 320;
    room.sensor.height = 240;
    room.sensor.focal_length_px = 262.5;
    return room;
  }
  // The frame of that time, where none is missing.
  OrbitFrame At(OrbitSequence& sequence, double time_s) const {
    return sequence.Frame(static_cast<int>(std::lround(time_s * params_.rate_hz)));
  }
  // Share of the pixels of true surface points whose depth says that the surface is there.
  double Shown(const OrbitFrame& orbit) const {
    int right = 0, all = 0;
    const TrueObject truth = world_.Truth()[0];
    for (Eigen::Index i = 0; i < truth.points.cols(); ++i) {
      const Eigen::Vector3d p = *orbit.T_camera_mesh * Eigen::Vector3d(truth.points.col(i));
      const auto pixel = orbit.frame.camera.Project(p);
      if (!pixel || !orbit.frame.camera.Contains(*pixel, 3)) continue;
      const auto depth_m = rgbd::DepthAt(orbit.frame, *pixel);
      ++all;
      right += depth_m && std::abs(*depth_m - p.z()) < 0.006;
    }
    return all ? static_cast<double>(right) / all : 0.0;
  }

  testing::PictureFolder pictures_;
  SimulatedWorld world_;
  SequenceParams params_;
};

TEST_F(Sequence, FramesAreNumberedTimedAndDoNotTellThePose) {
  OrbitSequence sequence(world_, params_);
  EXPECT_EQ(sequence.size(), static_cast<int>(375.0 / 30.0 * 5.0) + 1);
  const OrbitFrame a = sequence.Frame(10), b = sequence.Frame(3), again = sequence.Frame(10);
  EXPECT_EQ(a.frame.id, 11);
  EXPECT_EQ(a.frame.utime, 2000000);
  EXPECT_FALSE(a.frame.T_world_camera.has_value());
  EXPECT_EQ(cv::norm(a.frame.color, again.frame.color, cv::NORM_INF), 0.0);
  EXPECT_GT(Shown(a), 0.3);  // About half of the points are on the far side.
  EXPECT_TRUE(a.usable && !a.faulty && b.usable);
  params_.tell_camera_pose = true;
  EXPECT_TRUE(OrbitSequence(world_, params_).Frame(0).frame.T_world_camera.has_value());
}

TEST_F(Sequence, ACoveredCameraSeesNothing) {
  params_.fault.fault = Fault::kCovered;
  OrbitSequence sequence(world_, params_);
  const OrbitFrame covered = At(sequence, 2.2), before = sequence.Frame(9), after = At(sequence, 4.2);
  // The camera goes on more slowly: 2 s at a quarter of 30 degrees/s, and 0.4 s at all of it.
  EXPECT_NEAR(geometry::Difference(before.T_world_camera, after.T_world_camera).rotation_rad, 24 * kDeg, 5 * kDeg);
  EXPECT_NEAR(sequence.ClosesAt_s(0), 12.0 + 1.5, 1e-9);
  EXPECT_TRUE(covered.faulty && !covered.usable);
  EXPECT_LT(cv::mean(covered.frame.color)[0], 10.0);
  EXPECT_EQ(cv::countNonZero(covered.frame.depth), 0);
  EXPECT_TRUE(!after.faulty && after.usable);
}

TEST_F(Sequence, AnotherObjectStandsInItsPlace) {
  params_.fault.fault = Fault::kSwapped;
  OrbitSequence sequence(world_, params_, 1);
  const OrbitFrame before = sequence.Frame(9), swapped = At(sequence, 2.0), after = At(sequence, 4.2);
  EXPECT_FALSE(swapped.T_camera_mesh.has_value());
  EXPECT_FALSE(swapped.usable);
  EXPECT_TRUE(after.T_camera_mesh && after.usable);
  EXPECT_GT(Shown(before), 0.3);
  EXPECT_GT(Shown(after), 0.3);
  // Something stands there: nearer than the table behind it.
  const OrbitFrame there = sequence.Frame(10);
  const auto depth_m = rgbd::DepthAt(there.frame, {160, 120});
  ASSERT_TRUE(depth_m.has_value());
  EXPECT_LT(*depth_m, 0.7);
}

TEST_F(Sequence, TheObjectIsMovedWhileTheCameraLooksAway) {
  params_.fault.fault = Fault::kMoved;
  OrbitSequence sequence(world_, params_);
  const geometry::Rigid before = sequence.Frame(0).T_world_camera * *sequence.Frame(0).T_camera_mesh;
  const OrbitFrame away = At(sequence, 3.0), after = At(sequence, 4.2);
  EXPECT_FALSE(away.usable);
  const auto pixel = away.frame.camera.Project(away.T_camera_mesh->translation());
  EXPECT_FALSE(pixel && away.frame.camera.Contains(*pixel));
  EXPECT_TRUE(after.usable);
  EXPECT_GT(Shown(after), 0.3);
  const geometry::PoseDifference moved = geometry::Difference(before, after.T_world_camera * *after.T_camera_mesh);
  EXPECT_NEAR(moved.translation_m, 0.15, 1e-6);
  EXPECT_NEAR(moved.rotation_rad, 60 * kDeg, 1e-6);
}

TEST_F(Sequence, AShakenCameraBlursAStoppedDepthStreamIsEmpty) {
  const auto sharpness = [](const OrbitFrame& orbit) {
    cv::Mat edges;
    cv::Laplacian(rgbd::Gray(orbit.frame)(cv::Rect(140, 100, 40, 40)), edges, CV_32F);
    return cv::norm(edges, cv::NORM_L1);
  };
  OrbitSequence calm(world_, params_);
  const double sharp = sharpness(calm.Frame(12));
  params_.fault.fault = Fault::kBlur;
  OrbitSequence shaken(world_, params_);
  EXPECT_LT(sharpness(shaken.Frame(12)), 0.6 * sharp);
  EXPECT_FALSE(shaken.Frame(12).usable);
  params_.fault.fault = Fault::kNoDepth;
  OrbitSequence blind(world_, params_);
  EXPECT_TRUE(blind.Frame(12).frame.depth.empty());
  EXPECT_FALSE(blind.Frame(16).frame.depth.empty());
}

TEST_F(Sequence, HalfOfTheFramesAreMissing) {
  params_.fault.fault = Fault::kDropped;
  params_.rate_hz = 30.0;
  OrbitSequence sequence(world_, params_);
  EXPECT_NEAR(sequence.size(), 60 + 0.5 * 315, 30);
  std::set<std::int64_t> ids;
  for (const int i : {0, 59, 60, 61, 62, sequence.size() - 1}) ids.insert(sequence.Frame(i).frame.id);
  EXPECT_TRUE(ids.count(1) && ids.count(60));
  EXPECT_GT(*ids.rbegin(), sequence.size());
  EXPECT_TRUE(sequence.Frame(100).usable);
}

TEST(Faults, AreNamed) {
  for (const std::string& name : FaultNames()) EXPECT_EQ(ToString(FaultFromString(name)), name);
  EXPECT_THROW(FaultFromString("tired"), std::invalid_argument);
}

}  // namespace
}  // namespace vantage::simulation
