// The path is a function of u, the time it would take at cruising speed throughout, so that du/dt <= 1 is the speed limit whatever
// mixture of translation and rotation is under way. Where two straight pieces meet, a quadratic Bezier curve (positions and
// orientations alike) joins them, over which the derivative by u changes linearly. How fast u may run is then found by one pass
// forwards and one backwards over a fine grid, as in time-optimal path parameterisation (Bobrow et al., 1985).
#include "motion/trajectory.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "motion/path_timing.h"

namespace vantage::motion {
namespace {

using geometry::Interpolate;
using geometry::Rigid;

constexpr double kLongestInterval_s = 0.05;  // Between waypoints.
constexpr double kLongestBlend_s = 0.25;     // On either side of a corner: keeps the turn within one blend small.
constexpr double kLongestCell_s = 0.01;      // Of the grid, in u.
constexpr double kSameDerivative = 1e-6;     // Relative to the limits.
constexpr double kNoMotion = 1e-9;           // Metres or radians.

// Linear and angular rate of change by u, world axes.
struct Rates {
  Eigen::Vector3d linear = Eigen::Vector3d::Zero();
  Eigen::Vector3d angular = Eigen::Vector3d::Zero();
};

struct Segment {
  Rigid from, to;
  double length_s = 0.0;  // In u.
  Rates rates;
};

// A stretch of the final path: straight (from, to), or a blend (from, corner, to).
struct Piece {
  double begin_s = 0.0, length_s = 0.0;
  bool is_blend = false;
  Rigid from, corner, to;
  Rates rates_from, rates_to;
  bool stop_at_end = false;  // A corner that is not rounded follows.

  Rigid At(double u) const {
    const double t = std::clamp((u - begin_s) / length_s, 0.0, 1.0);
    if (!is_blend) return Interpolate(from, to, t);
    return Interpolate(Interpolate(from, corner, t), Interpolate(corner, to, t), t);
  }
};

// A cell of the grid over u.
struct Cell {
  std::size_t piece = 0;
  double begin_s = 0.0, length_s = 0.0;
  Rates first, second;  // Derivatives by u at its middle.
};

std::vector<Segment> MakeSegments(const std::vector<Rigid>& poses, const SpeedLimits& limits) {
  std::vector<Segment> segments;
  Rigid from = poses.front();
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const Rigid& to = poses[i];
    const Eigen::Vector3d move = to.translation() - from.translation();
    const Eigen::AngleAxisd turn(Eigen::Matrix3d(to.linear() * from.linear().transpose()));
    if (move.norm() < kNoMotion && std::abs(turn.angle()) < kNoMotion) continue;
    Segment segment{
        from, to, std::max(move.norm() / limits.max_speed_m_s, std::abs(turn.angle()) / limits.max_turn_rate_rad_s), {}};
    segment.rates = {move / segment.length_s, turn.axis() * turn.angle() / segment.length_s};
    segments.push_back(segment);
    from = to;
  }
  return segments;
}

// How far before and after the corner between two segments the blend reaches, in u: 0 = none is needed, negative = stop there.
double BlendReach(const Segment& before, const Segment& after, const SpeedLimits& limits, double corner_cut_m) {
  const double linear_change = (after.rates.linear - before.rates.linear).norm();
  const double angular_change = (after.rates.angular - before.rates.angular).norm();
  if (linear_change < kSameDerivative * limits.max_speed_m_s && angular_change < kSameDerivative * limits.max_turn_rate_rad_s) {
    return 0.0;
  }
  if (corner_cut_m <= 0.0) return -1.0;
  double reach_s = std::min({before.length_s / 2.0, after.length_s / 2.0, kLongestBlend_s});
  // The curve passes the corner at reach * change / 4.
  if (linear_change > 0.0) reach_s = std::min(reach_s, 4.0 * corner_cut_m / linear_change);
  return reach_s;
}

std::vector<Piece> MakePieces(const std::vector<Segment>& segments, const SpeedLimits& limits, double corner_cut_m) {
  std::vector<Piece> pieces;
  double u = 0.0;
  const auto add = [&](Piece piece) {
    piece.begin_s = u;
    u += piece.length_s;
    pieces.push_back(piece);
  };
  double reach_before_s = 0.0;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const Segment& segment = segments[i];
    const bool is_last = i + 1 == segments.size();
    const double reach_s = is_last ? 0.0 : BlendReach(segment, segments[i + 1], limits, corner_cut_m);
    const double reach_after_s = std::max(reach_s, 0.0);
    const Rigid begin = Interpolate(segment.from, segment.to, reach_before_s / segment.length_s);
    const Rigid end = Interpolate(segment.from, segment.to, 1.0 - reach_after_s / segment.length_s);
    const double straight_s = segment.length_s - reach_before_s - reach_after_s;
    if (straight_s > 1e-9) add({0.0, straight_s, false, begin, begin, end, segment.rates, segment.rates, reach_s < 0.0});
    if (reach_s > 0.0) {
      const Segment& next = segments[i + 1];
      const Rigid after = Interpolate(next.from, next.to, reach_s / next.length_s);
      add({0.0, 2.0 * reach_s, true, end, segment.to, after, segment.rates, next.rates, false});
    }
    reach_before_s = reach_after_s;
  }
  return pieces;
}

std::vector<Cell> MakeCells(const std::vector<Piece>& pieces) {
  const double total_s = pieces.back().begin_s + pieces.back().length_s;
  const double cell_s = std::min(kLongestCell_s, total_s / 200.0);
  std::vector<Cell> cells;
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    const Piece& piece = pieces[p];
    const int count = std::max(piece.is_blend ? 16 : 4, static_cast<int>(std::ceil(piece.length_s / cell_s)));
    const double length_s = piece.length_s / count;
    for (int i = 0; i < count; ++i) {
      Cell cell{p, piece.begin_s + i * length_s, length_s, {}, {}};
      const double t = (i + 0.5) / count;
      cell.first.linear = (1.0 - t) * piece.rates_from.linear + t * piece.rates_to.linear;
      cell.first.angular = (1.0 - t) * piece.rates_from.angular + t * piece.rates_to.angular;
      cell.second.linear = (piece.rates_to.linear - piece.rates_from.linear) / piece.length_s;
      cell.second.angular = (piece.rates_to.angular - piece.rates_from.angular) / piece.length_s;
      cells.push_back(cell);
    }
  }
  return cells;
}

// The highest (du/dt)^2 in a cell: at cruising speed, and such that u can run evenly (which keeps every speed below feasible too).
double SquaredRateCap(const Cell& cell, const SpeedLimits& limits) {
  double cap = 1.0;
  const double linear = cell.second.linear.norm(), angular = cell.second.angular.norm();
  if (linear > 0.0) cap = std::min(cap, limits.max_acceleration_m_s2 / linear);
  if (angular > 0.0) cap = std::min(cap, limits.max_turn_acceleration_rad_s2 / angular);
  return cap;
}

// The largest |d2u/dt2| >= 0 towards `sign` that keeps |second * squared_rate + first * d2u/dt2| <= limit.
double LargestChange(const Eigen::Vector3d& first, const Eigen::Vector3d& second, double squared_rate, double limit, double sign) {
  const double a = first.squaredNorm();
  if (a < 1e-18) return std::numeric_limits<double>::infinity();
  const double b = sign * squared_rate * first.dot(second);
  const double c = squared_rate * squared_rate * second.squaredNorm() - limit * limit;
  return std::max(0.0, (-b + std::sqrt(std::max(0.0, b * b - a * c))) / a);
}

double LargestChange(const Cell& cell, double squared_rate, const SpeedLimits& limits, double sign) {
  const double linear = LargestChange(cell.first.linear, cell.second.linear, squared_rate, limits.max_acceleration_m_s2, sign);
  const double angular =
      LargestChange(cell.first.angular, cell.second.angular, squared_rate, limits.max_turn_acceleration_rad_s2, sign);
  return std::min(linear, angular);
}

Trajectory Sample(const std::vector<Piece>& pieces, const std::vector<Cell>& cells, const std::vector<double>& rates) {
  Trajectory trajectory;
  trajectory.waypoints.push_back({0.0, pieces.front().from});
  const double end_s = SampleEvenly(cells, rates, kLongestInterval_s, [&](double time_s, const Cell& cell, double u) {
    trajectory.waypoints.push_back({time_s, pieces[cell.piece].At(u)});
  });
  trajectory.waypoints.push_back({end_s, pieces.back().to});
  return trajectory;
}

void CheckPositive(double value, const char* field) {
  if (!(value > 0.0) || !std::isfinite(value)) {
    throw std::invalid_argument(std::string(field) + " must be > 0, is " + std::to_string(value));
  }
}

}  // namespace

void SpeedLimits::Check() const {
  CheckPositive(max_speed_m_s, "max_speed_m_s");
  CheckPositive(max_acceleration_m_s2, "max_acceleration_m_s2");
  CheckPositive(max_turn_rate_rad_s, "max_turn_rate_rad_s");
  CheckPositive(max_turn_acceleration_rad_s2, "max_turn_acceleration_rad_s2");
}

Waypoint Trajectory::Sample(double time_s) const {
  if (waypoints.empty()) throw std::logic_error("a trajectory without waypoints has no pose");
  const auto after = std::lower_bound(waypoints.begin(), waypoints.end(), time_s,
                                      [](const Waypoint& waypoint, double time) { return waypoint.time_s < time; });
  if (after == waypoints.begin()) return waypoints.front();
  if (after == waypoints.end()) return waypoints.back();
  const Waypoint& before = *(after - 1);
  const double share = (time_s - before.time_s) / (after->time_s - before.time_s);
  Waypoint sample{time_s, Interpolate(before.T_world_mount, after->T_world_mount, share)};
  if (before.joints_rad.size() > 0) sample.joints_rad = (1.0 - share) * before.joints_rad + share * after->joints_rad;
  return sample;
}

Trajectory TimePath(const std::vector<Rigid>& poses, const SpeedLimits& limits, double corner_cut_m) {
  limits.Check();
  if (poses.empty()) throw std::invalid_argument("a path needs at least one pose, has none");
  if (!(corner_cut_m >= 0.0)) throw std::invalid_argument("corner_cut_m must be >= 0, is " + std::to_string(corner_cut_m));
  for (const Rigid& pose : poses) {
    if (!pose.matrix().allFinite()) throw std::invalid_argument("a pose of the path is not finite");
  }
  const std::vector<Segment> segments = MakeSegments(poses, limits);
  if (segments.empty()) return Trajectory{{Waypoint{0.0, poses.front()}}};
  const std::vector<Piece> pieces = MakePieces(segments, limits, corner_cut_m);
  const std::vector<Cell> cells = MakeCells(pieces);
  const std::vector<double> rates = SquaredRates(
      pieces, cells, [&](const Cell& cell) { return SquaredRateCap(cell, limits); },
      [&](const Cell& cell, double squared_rate, double sign) { return LargestChange(cell, squared_rate, limits, sign); });
  return Sample(pieces, cells, rates);
}

}  // namespace vantage::motion
