#include "measures/predicted.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>

namespace vantage::measures {
namespace {

constexpr int kRows = PredictedSuccess::kRotationCells;
constexpr int kColumns = PredictedSuccess::kScaleCells;
constexpr int kCells = kRows * kColumns;

// Measured on photographs of a textured box, one learned view, per 5 degrees at the learned scale.
constexpr std::array<double, kRows> kDefaultOverRotation = {0.99, 0.97, 0.93, 0.83, 0.64, 0.44, 0.24, 0.17, 0.08,
                                                            0.04, 0.02, 0.01, 0.0,  0.0,  0.0,  0.0,  0.0,  0.0};
constexpr std::array<double, kColumns> kDefaultOverScale = {0.67, 0.87, 1.0, 0.87, 0.67};

double DefaultProbability(int row, int column) { return kDefaultOverRotation[row] * kDefaultOverScale[column]; }

// How the object at hand differs from the default: its log odds are the default's plus x . (1, theta, s, s^2), theta in radians.
// Maximum a posteriori with independent Gaussians about 0, so that without trials it does not.
using Difference = Eigen::Vector4d;
const Difference kDifferenceSigma(0.8, 2.5, 1.0, 1.0);
constexpr double kLeastDefault = 0.002;  // Log odds stay finite.

Eigen::Vector4d DifferenceBasis(int row, int column) {
  const double theta = (row + 0.5) * PredictedSuccess::kRotationStepRad;
  const double s = (column - 0.5 * (kColumns - 1)) * PredictedSuccess::kScaleStep;
  return {1.0, theta, s, s * s};
}

double WithDifference(int row, int column, const Difference& difference) {
  const double p = std::clamp(DefaultProbability(row, column), kLeastDefault, 1.0 - kLeastDefault);
  return 1.0 / (1.0 + std::exp(-std::log(p / (1.0 - p)) - difference.dot(DifferenceBasis(row, column))));
}

// Newton's method; the posterior has one maximum.
Difference FitDifference(const std::vector<double>& trials, const std::vector<double>& successes) {
  const Difference precision = kDifferenceSigma.array().square().inverse();
  Difference x = Difference::Zero();
  for (int iteration = 0; iteration < 30; ++iteration) {
    Eigen::Vector4d gradient = -precision.cwiseProduct(x);
    Eigen::Matrix4d curvature = precision.asDiagonal();
    for (int cell = 0; cell < kCells; ++cell) {
      if (trials[cell] <= 0.0) continue;
      const int row = cell / kColumns, column = cell % kColumns;
      const Eigen::Vector4d basis = DifferenceBasis(row, column);
      const double p = WithDifference(row, column, x);
      gradient += (successes[cell] - trials[cell] * p) * basis;
      curvature += trials[cell] * p * (1.0 - p) * basis * basis.transpose();
    }
    const Difference step = curvature.ldlt().solve(gradient);
    x += step * std::min(1.0, 2.0 / std::max(1e-12, step.norm()));  // Far from the maximum it overshoots.
    if (step.norm() < 1e-9) break;
  }
  return x;
}

// A position on an axis of cell centres, between `cell` and the next one; held at the ends.
struct Between {
  int cell = 0;
  double share_of_next = 0.0;
};

Between Locate(double position, int cells) {
  const double clamped = std::clamp(position, 0.0, cells - 1.0);
  const int cell = std::min(static_cast<int>(clamped), cells - 2);
  return {cell, clamped - cell};
}

Between LocateRotation(double rotation_rad) { return Locate(rotation_rad / PredictedSuccess::kRotationStepRad - 0.5, kRows); }

Between LocateScale(double log2_scale) {
  return Locate(log2_scale / PredictedSuccess::kScaleStep + 0.5 * (kColumns - 1), kColumns);
}

// Every cell with half of what its neighbours along each axis have, a quarter of the diagonal ones.
std::vector<double> Shared(const std::vector<double>& counts) {
  std::vector<double> shared(kCells, 0.0);
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      for (int r = std::max(0, row - 1); r <= std::min(kRows - 1, row + 1); ++r) {
        for (int c = std::max(0, column - 1); c <= std::min(kColumns - 1, column + 1); ++c) {
          const double weight = (r == row ? 1.0 : 0.5) * (c == column ? 1.0 : 0.5);
          shared[row * kColumns + column] += weight * counts[r * kColumns + c];
        }
      }
    }
  }
  return shared;
}

// Weighted isotonic regression, non-increasing, by pooling adjacent violators.
void MakeNonIncreasing(std::array<double, kRows>* values, const std::array<double, kRows>& weights) {
  struct Block {
    double value, weight;
    int length;
  };
  std::vector<Block> blocks;
  for (int i = 0; i < kRows; ++i) {
    blocks.push_back({(*values)[i], weights[i], 1});
    while (blocks.size() > 1 && blocks[blocks.size() - 2].value < blocks.back().value) {
      const Block last = blocks.back();
      blocks.pop_back();
      Block& pooled = blocks.back();
      const double weight = pooled.weight + last.weight;
      pooled = {(pooled.value * pooled.weight + last.value * last.weight) / weight, weight, pooled.length + last.length};
    }
  }
  int i = 0;
  for (const Block& block : blocks) {
    for (int k = 0; k < block.length; ++k) (*values)[i++] = block.value;
  }
}

std::vector<double> ProbabilityTable(const std::vector<double>& trials, const std::vector<double>& successes, double prior_count) {
  const std::vector<double> shared_trials = Shared(trials), shared_successes = Shared(successes);
  const bool tried = std::any_of(trials.begin(), trials.end(), [](double count) { return count > 0.0; });
  const Difference difference = tried ? FitDifference(trials, successes) : Difference::Zero();
  std::vector<double> table(kCells);
  for (int column = 0; column < kColumns; ++column) {
    std::array<double, kRows> values, weights;
    for (int row = 0; row < kRows; ++row) {
      const int cell = row * kColumns + column;
      // Equation (12): p(theta|o) p(o) / p(theta) is the ratio of successes to trials.
      weights[row] = shared_trials[cell] + prior_count;
      const double expected = tried ? WithDifference(row, column, difference) : DefaultProbability(row, column);
      values[row] = (shared_successes[cell] + prior_count * expected) / weights[row];
    }
    MakeNonIncreasing(&values, weights);
    for (int row = 0; row < kRows; ++row) table[row * kColumns + column] = values[row];
  }
  return table;
}

void CheckCounts(const std::vector<double>& trials, const std::vector<double>& successes) {
  if (trials.size() != kCells || successes.size() != kCells) {
    throw std::invalid_argument("PredictedSuccess: expected " + std::to_string(kCells) + " counts, found " +
                                std::to_string(trials.size()) + " trials and " + std::to_string(successes.size()) + " successes");
  }
  for (int i = 0; i < kCells; ++i) {
    // Sums of shares: allow for rounding.
    if (!(successes[i] >= 0.0 && successes[i] <= trials[i] + 1e-6 && std::isfinite(trials[i]))) {
      throw std::invalid_argument("PredictedSuccess: counts must hold 0 <= success <= trial, cell " + std::to_string(i) +
                                  " does not");
    }
  }
}

}  // namespace

PredictedSuccess::PredictedSuccess()
    : PredictedSuccess(FromCounts(std::vector<double>(kCells, 0.0), std::vector<double>(kCells, 0.0), Source::kDefault)) {}

PredictedSuccess::PredictedSuccess(std::vector<double> trials, std::vector<double> successes, Source source, double prior_count)
    : trials_(std::move(trials)),
      successes_(std::move(successes)),
      table_(ProbabilityTable(trials_, successes_, prior_count)),
      prior_count_(prior_count),
      source_(source) {}

PredictedSuccess PredictedSuccess::Fit(const std::vector<PredictionSample>& samples, Source source, double prior_count) {
  std::vector<double> trials(kCells, 0.0), successes(kCells, 0.0);
  int used = 0;
  for (const PredictionSample& sample : samples) {
    if (!(sample.rotation_rad < M_PI_2)) continue;  // Not on the grid: nothing learned is in view.
    ++used;
    const Between rotation = LocateRotation(sample.rotation_rad), scale = LocateScale(sample.log2_scale);
    for (int k = 0; k < 4; ++k) {
      const double weight = (k / 2 ? rotation.share_of_next : 1.0 - rotation.share_of_next) *
                            (k % 2 ? scale.share_of_next : 1.0 - scale.share_of_next);
      const int cell = (rotation.cell + k / 2) * kColumns + scale.cell + k % 2;
      trials[cell] += weight;
      if (sample.detected) successes[cell] += weight;
    }
  }
  return FromCounts(std::move(trials), std::move(successes), used > 0 ? source : Source::kDefault, prior_count);
}

PredictedSuccess PredictedSuccess::FromCounts(std::vector<double> trials, std::vector<double> successes, Source source,
                                              double prior_count) {
  CheckCounts(trials, successes);
  if (!(prior_count > 0.0 && std::isfinite(prior_count))) {
    throw std::invalid_argument("PredictedSuccess: prior_count must be > 0, is " + std::to_string(prior_count));
  }
  return PredictedSuccess(std::move(trials), std::move(successes), source, prior_count);
}

double PredictedSuccess::Probability(double rotation_rad, double log2_scale) const {
  if (!(std::abs(rotation_rad) < M_PI_2) || std::isnan(log2_scale)) return 0.0;
  const double angle = std::abs(rotation_rad);
  const Between rotation = LocateRotation(angle), scale = LocateScale(log2_scale);
  const auto along_scale = [&](int row) {
    const double* cells = &table_[row * kColumns + scale.cell];
    return (1.0 - scale.share_of_next) * cells[0] + scale.share_of_next * cells[1];
  };
  double p = (1.0 - rotation.share_of_next) * along_scale(rotation.cell) + rotation.share_of_next * along_scale(rotation.cell + 1);
  // From the last centre to 90 degrees, and over the octave beyond the grid where nothing was tried: down to nothing.
  p *= std::min(1.0, (M_PI_2 - angle) / (0.5 * kRotationStepRad));
  return p * std::clamp(2.0 - std::abs(log2_scale), 0.0, 1.0);
}

double PredictedSuccess::HalfwayRotation() const {
  double below = 0.0, above = M_PI_2;
  if (Probability(below) < 0.5) return 0.0;
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (below + above);
    (Probability(middle) >= 0.5 ? below : above) = middle;
  }
  return below;
}

void PredictedSuccess::set_common_cause(double share) {
  if (!(share >= 0.0 && share <= 1.0)) {
    throw std::invalid_argument("PredictedSuccess: common_cause must be in [0, 1], is " + std::to_string(share));
  }
  common_cause_ = share;
}

int PredictedSuccess::trials() const { return static_cast<int>(std::lround(std::accumulate(trials_.begin(), trials_.end(), 0.0))); }

}  // namespace vantage::measures
