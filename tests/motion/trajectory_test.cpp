#include "motion/trajectory.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support.h"

namespace vantage::motion {
namespace {

using geometry::Rigid;

Rigid At(double x, double y, double z, double yaw_rad = 0.0) {
  Rigid pose = Rigid::Identity();
  pose.translation() = Eigen::Vector3d(x, y, z);
  pose.linear() = Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return pose;
}

struct Extremes {
  double speed = 0.0, acceleration = 0.0, turn_rate = 0.0, turn_acceleration = 0.0, interval_s = 0.0;
};

// By differences between waypoints, at rest before and after.
Extremes Measure(const Trajectory& trajectory) {
  Extremes most;
  Eigen::Vector3d last_velocity = Eigen::Vector3d::Zero(), last_turn = Eigen::Vector3d::Zero();
  double last_interval_s = 0.0;
  const auto step = [&](const Eigen::Vector3d& velocity, const Eigen::Vector3d& turn, double interval_s) {
    const double between_s = last_interval_s > 0.0 ? (interval_s + last_interval_s) / 2.0 : interval_s;
    most.speed = std::max(most.speed, velocity.norm());
    most.turn_rate = std::max(most.turn_rate, turn.norm());
    most.acceleration = std::max(most.acceleration, (velocity - last_velocity).norm() / between_s);
    most.turn_acceleration = std::max(most.turn_acceleration, (turn - last_turn).norm() / between_s);
    most.interval_s = std::max(most.interval_s, interval_s);
    last_velocity = velocity;
    last_turn = turn;
    last_interval_s = interval_s;
  };
  const auto& waypoints = trajectory.waypoints;
  for (std::size_t i = 1; i < waypoints.size(); ++i) {
    const double interval_s = waypoints[i].time_s - waypoints[i - 1].time_s;
    EXPECT_GT(interval_s, 0.0);
    const Rigid &a = waypoints[i - 1].T_world_mount, &b = waypoints[i].T_world_mount;
    const Eigen::AngleAxisd turn(Eigen::Matrix3d(b.linear() * a.linear().transpose()));
    step((b.translation() - a.translation()) / interval_s, turn.axis() * turn.angle() / interval_s, interval_s);
  }
  step(Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), last_interval_s);
  return most;
}

void ExpectWithinLimits(const Trajectory& trajectory, const SpeedLimits& limits) {
  const Extremes most = Measure(trajectory);
  EXPECT_LE(most.speed, limits.max_speed_m_s * 1.02);
  EXPECT_LE(most.acceleration, limits.max_acceleration_m_s2 * 1.02);
  EXPECT_LE(most.turn_rate, limits.max_turn_rate_rad_s * 1.02);
  EXPECT_LE(most.turn_acceleration, limits.max_turn_acceleration_rad_s2 * 1.03);
  EXPECT_LE(most.interval_s, 0.05 + 1e-9);
}

// Time of a trapezoidal (or triangular) profile.
double ProfileTime(double way, double speed, double acceleration) {
  return way >= speed * speed / acceleration ? way / speed + speed / acceleration : 2.0 * std::sqrt(way / acceleration);
}

double DistanceToSegment(const Eigen::Vector3d& point, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const double t = std::clamp((point - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
  return (point - a - t * (b - a)).norm();
}

TEST(TimePath, StraightMovesTakeTheTimeOfTheTrapezoid) {
  const SpeedLimits limits;
  for (const double way_m : {0.001, 0.02, 0.1, 0.125, 0.2, 0.5, 1.7}) {
    const Trajectory trajectory = TimePath({At(0, 0, 0), At(0.6 * way_m, 0, 0.8 * way_m)}, limits);
    EXPECT_NEAR(trajectory.duration_s(), ProfileTime(way_m, 0.25, 0.5), 0.005 * trajectory.duration_s()) << way_m;
    ExpectWithinLimits(trajectory, limits);
  }
}

TEST(TimePath, TurnsOnTheSpotTakeTheTimeOfTheTrapezoid) {
  const SpeedLimits limits;
  for (const double turn_rad : {0.01, 0.3, 1.0, 3.0}) {
    const Trajectory trajectory = TimePath({At(1, 2, 3), At(1, 2, 3, turn_rad)}, limits);
    EXPECT_NEAR(trajectory.duration_s(), ProfileTime(turn_rad, 0.8, 1.6), 0.005 * trajectory.duration_s()) << turn_rad;
    ExpectWithinLimits(trajectory, limits);
  }
}

TEST(TimePath, TheSlowerOfMovingAndTurningDecides) {
  const SpeedLimits limits;
  const double move_s = TimePath({At(0, 0, 0), At(0.5, 0, 0)}, limits).duration_s();
  EXPECT_NEAR(TimePath({At(0, 0, 0), At(0.5, 0, 0, 0.2)}, limits).duration_s(), move_s, 0.01 * move_s);
  const double turn_s = TimePath({At(0, 0, 0), At(0, 0, 0, 2.5)}, limits).duration_s();
  EXPECT_NEAR(TimePath({At(0, 0, 0), At(0.1, 0, 0, 2.5)}, limits).duration_s(), turn_s, 0.01 * turn_s);
}

TEST(TimePath, EndsAreExactAndTheTimeGrowsWithTheWay) {
  Random random(4);
  const std::vector<Rigid> poses = {random.Pose(0.5), random.Pose(0.5), random.Pose(0.5)};
  const Trajectory trajectory = TimePath(poses, {});
  EXPECT_TRUE(trajectory.At(-1.0).isApprox(poses.front(), 1e-9));
  EXPECT_TRUE(trajectory.At(trajectory.duration_s()).isApprox(poses.back(), 1e-9));
  EXPECT_TRUE(trajectory.At(1e9).isApprox(poses.back(), 1e-9));
  double last_s = 0.0;
  for (int i = 1; i <= 10; ++i) {
    const double duration_s = TimePath({At(0, 0, 0), At(0.1 * i, 0, 0)}, {}).duration_s();
    EXPECT_GT(duration_s, last_s);
    last_s = duration_s;
  }
}

TEST(TimePath, CornersAreRoundedWithinTheCutAndPassedMoving) {
  const SpeedLimits limits;
  const std::vector<Rigid> poses = {At(0, 0, 0), At(0.5, 0, 0), At(0.5, 0.5, 0)};
  const Trajectory rounded = TimePath(poses, limits, 0.005), exact = TimePath(poses, limits, 0.0);
  ExpectWithinLimits(rounded, limits);
  ExpectWithinLimits(exact, limits);
  EXPECT_NEAR(exact.duration_s(), 2.0 * ProfileTime(0.5, 0.25, 0.5), 0.03);
  EXPECT_LT(rounded.duration_s(), exact.duration_s() - 0.1);
  double furthest_m = 0.0, slowest_m_s = 1.0;
  for (double t = 0.0; t <= rounded.duration_s(); t += 0.005) {
    const Eigen::Vector3d point = rounded.At(t).translation();
    furthest_m = std::max(furthest_m, std::min(DistanceToSegment(point, poses[0].translation(), poses[1].translation()),
                                               DistanceToSegment(point, poses[1].translation(), poses[2].translation())));
    if (t > 0.6 && t < rounded.duration_s() - 0.6) {
      slowest_m_s = std::min(slowest_m_s, (rounded.At(t + 0.01).translation() - point).norm() / 0.01);
    }
  }
  EXPECT_LE(furthest_m, 0.005);
  EXPECT_GT(furthest_m, 0.002);
  EXPECT_GT(slowest_m_s, 0.05);
}

TEST(TimePath, PosesOnOneLineCostNothing) {
  std::vector<Rigid> poses;
  for (int i = 0; i <= 20; ++i) poses.push_back(At(0.05 * i, 0, 0, 0.05 * i));
  const double duration_s = TimePath({poses.front(), poses.back()}, {}).duration_s();
  EXPECT_NEAR(TimePath(poses, {}).duration_s(), duration_s, 0.005 * duration_s);
}

// Random polylines: moves, turns on the spot, repeated poses, sharp reversals, with other limits each time.
TEST(TimePath, KeepsTheLimitsOnAnyPath) {
  for (std::uint32_t seed = 0; seed < 60; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    SpeedLimits limits;
    limits.max_speed_m_s = random.Uniform(0.05, 1.0);
    limits.max_acceleration_m_s2 = random.Uniform(0.1, 2.0);
    limits.max_turn_rate_rad_s = random.Uniform(0.2, 1.5);
    limits.max_turn_acceleration_rad_s2 = random.Uniform(0.5, 4.0);
    std::vector<Rigid> poses = {random.Pose(0.5)};
    for (int i = 0; i < 6; ++i) {
      Rigid next = random.Pose(0.5);
      if (i % 3 == 1) next.translation() = poses.back().translation();
      if (i % 3 == 2) next.linear() = poses.back().linear();
      poses.push_back(next);
      if (i % 2 == 0) poses.push_back(next);
      if (i == 4) poses.push_back(poses[poses.size() - 3]);
    }
    const Trajectory trajectory = TimePath(poses, limits);
    ExpectWithinLimits(trajectory, limits);
    EXPECT_TRUE(trajectory.At(1e9).isApprox(poses.back(), 1e-9));
    ExpectWithinLimits(TimePath(poses, limits, 0.0), limits);
  }
}

TEST(TimePath, OnePlaceIsOneWaypoint) {
  const Trajectory trajectory = TimePath({At(1, 2, 3), At(1, 2, 3)}, {});
  ASSERT_EQ(trajectory.waypoints.size(), 1u);
  EXPECT_EQ(trajectory.duration_s(), 0.0);
  EXPECT_TRUE(trajectory.At(3.0).isApprox(At(1, 2, 3)));
}

TEST(TimePath, RefusesNonsense) {
  EXPECT_THROW(TimePath({}, {}), std::invalid_argument);
  EXPECT_THROW(TimePath({At(0, 0, 0), At(std::nan(""), 0, 0)}, {}), std::invalid_argument);
  EXPECT_THROW(TimePath({At(0, 0, 0)}, {}, -0.1), std::invalid_argument);
  SpeedLimits limits;
  limits.max_turn_rate_rad_s = 0.0;
  EXPECT_THROW(TimePath({At(0, 0, 0)}, limits), std::invalid_argument);
  EXPECT_THROW(Trajectory().At(0.0), std::logic_error);
}

}  // namespace
}  // namespace vantage::motion
