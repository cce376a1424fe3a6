// The same method as trajectory.cpp, joint by joint: u is the time at cruising speed, corners are quadratic Bezier curves, and how
// fast u may run is found by one pass forwards and one backwards.
#include "motion/joint_path.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "motion/path_timing.h"

namespace vantage::motion {
namespace {

using Joints = Eigen::VectorXd;

constexpr double kLongestInterval_s = 0.05;
constexpr double kLongestBlend_s = 0.4;
constexpr double kLongestCell_s = 0.02;
constexpr double kNoMotion_rad = 1e-9;
constexpr double kNoChange = 1e-9;

struct Segment {
  Joints from, to, rates;  // Rates by u.
  double length_s = 0.0;
};

struct Piece {
  double begin_s = 0.0, length_s = 0.0;
  bool is_blend = false;
  Joints from, corner, to, rates_from, rates_to;
  bool stop_at_end = false;

  Joints At(double u) const {
    const double t = std::clamp((u - begin_s) / length_s, 0.0, 1.0);
    if (!is_blend) return from + t * (to - from);
    return (1.0 - t) * (1.0 - t) * from + 2.0 * t * (1.0 - t) * corner + t * t * to;
  }
};

struct Cell {
  std::size_t piece = 0;
  double begin_s = 0.0, length_s = 0.0;
  Joints first, second;
};

std::vector<Segment> MakeSegments(const std::vector<Joints>& polyline, const JointLimits& limits) {
  std::vector<Segment> segments;
  for (std::size_t i = 1; i < polyline.size(); ++i) {
    const Joints turn = polyline[i] - polyline[i - 1];
    if (turn.cwiseAbs().maxCoeff() < kNoMotion_rad) continue;
    Segment segment{polyline[i - 1], polyline[i], {}, turn.cwiseAbs().cwiseQuotient(limits.max_speed_rad_s).maxCoeff()};
    segment.rates = turn / segment.length_s;
    segments.push_back(segment);
  }
  return segments;
}

// How far the blend reaches before and after a corner, in u: 0 = none is needed, negative = stop there.
double BlendReach(const Segment& before, const Segment& after, const JointLimits& limits, double corner_cut_m) {
  const double change_m = (after.rates - before.rates).cwiseAbs().dot(limits.reach_m);
  if (change_m < kNoChange) return 0.0;
  if (corner_cut_m <= 0.0) return -1.0;
  // The curve passes the corner at reach * change / 4.
  return std::min({before.length_s / 2.0, after.length_s / 2.0, kLongestBlend_s, 4.0 * corner_cut_m / change_m});
}

std::vector<Piece> MakePieces(const std::vector<Segment>& segments, const JointLimits& limits, double corner_cut_m) {
  std::vector<Piece> pieces;
  double u = 0.0, reach_before_s = 0.0;
  const auto add = [&](Piece piece) {
    piece.begin_s = u;
    u += piece.length_s;
    pieces.push_back(std::move(piece));
  };
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const Segment& segment = segments[i];
    const double reach_s = i + 1 == segments.size() ? 0.0 : BlendReach(segment, segments[i + 1], limits, corner_cut_m);
    const double reach_after_s = std::max(reach_s, 0.0);
    const Joints begin = segment.from + reach_before_s * segment.rates, end = segment.to - reach_after_s * segment.rates;
    const double straight_s = segment.length_s - reach_before_s - reach_after_s;
    if (straight_s > 1e-9) add({0.0, straight_s, false, begin, begin, end, segment.rates, segment.rates, reach_s < 0.0});
    if (reach_s > 0.0) {
      const Segment& next = segments[i + 1];
      add({0.0, 2.0 * reach_s, true, end, segment.to, next.from + reach_s * next.rates, segment.rates, next.rates, false});
    }
    reach_before_s = reach_after_s;
  }
  return pieces;
}

std::vector<Cell> MakeCells(const std::vector<Piece>& pieces) {
  std::vector<Cell> cells;
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    const Piece& piece = pieces[p];
    const int count = std::max(8, static_cast<int>(std::ceil(piece.length_s / kLongestCell_s)));
    for (int i = 0; i < count; ++i) {
      const double t = (i + 0.5) / count;
      cells.push_back({p, piece.begin_s + piece.length_s * i / count, piece.length_s / count,
                       (1.0 - t) * piece.rates_from + t * piece.rates_to, (piece.rates_to - piece.rates_from) / piece.length_s});
    }
  }
  return cells;
}

double SquaredRateCap(const Cell& cell, const JointLimits& limits) {
  double cap = 1.0;
  for (Eigen::Index j = 0; j < cell.second.size(); ++j) {
    const double change = std::abs(cell.second[j]);
    if (change > kNoChange) cap = std::min(cap, limits.max_acceleration_rad_s2[j] / change);
  }
  return cap;
}

// The largest |d2u/dt2| >= 0 towards `sign` that keeps every |second * squared_rate + first * d2u/dt2| within its limit.
double LargestChange(const Cell& cell, double squared_rate, const JointLimits& limits, double sign) {
  double largest = std::numeric_limits<double>::infinity();
  for (Eigen::Index j = 0; j < cell.first.size(); ++j) {
    const double slope = sign * cell.first[j], bias = squared_rate * cell.second[j];
    if (std::abs(slope) < kNoChange) continue;
    const double room = limits.max_acceleration_rad_s2[j] - (slope > 0.0 ? bias : -bias);
    largest = std::min(largest, std::max(0.0, room) / std::abs(slope));
  }
  return largest;
}

}  // namespace

std::vector<TimedJoints> TimeJointPath(const std::vector<Joints>& polyline, const JointLimits& limits, double corner_cut_m) {
  if (polyline.empty()) throw std::invalid_argument("a path needs at least one posture, has none");
  const std::vector<Segment> segments = MakeSegments(polyline, limits);
  if (segments.empty()) return {{0.0, polyline.front()}};
  const std::vector<Piece> pieces = MakePieces(segments, limits, corner_cut_m);
  const std::vector<Cell> cells = MakeCells(pieces);
  const std::vector<double> rates = SquaredRates(
      pieces, cells, [&](const Cell& cell) { return SquaredRateCap(cell, limits); },
      [&](const Cell& cell, double squared_rate, double sign) { return LargestChange(cell, squared_rate, limits, sign); });
  std::vector<TimedJoints> path{{0.0, polyline.front()}};
  const double end_s = SampleEvenly(cells, rates, kLongestInterval_s, [&](double time_s, const Cell& cell, double u) {
    path.push_back({time_s, pieces[cell.piece].At(u)});
  });
  path.push_back({end_s, polyline.back()});
  return path;
}

}  // namespace vantage::motion
