// Predicted detection success p(o|theta, s): how likely an object view learned from one direction and distance is detected from
// another (equations 11, 12).
#pragma once

#include <vector>

#include "measures/observed.h"

namespace vantage::measures {

// One trial: the recogniser was offered one view and shown the object from elsewhere.
struct PredictionSample {
  double rotation_rad = 0.0;  // Out-of-plane angle between the learned and the seen direction, [0, pi].
  double log2_scale = 0.0;    // log2(learned distance / seen distance): > 0 means closer than learned.
  bool detected = false;
};

// The grid of counts. By Bayes with p(o) = share of successes, (12) is the ratio of counts; here smoothed: neighbouring cells share
// trials by a triangular kernel, and every cell starts with `prior_count` pseudo-trials, so that few trials are never sure. Those
// succeed as often as the shipped default says once it is shifted to all trials of the object: its log odds plus a linear function
// of rotation, scale and squared scale, held towards none.
class PredictedSuccess {
 public:
  static constexpr int kRotationCells = 18;  // 5 degrees each, from 0 to 90.
  static constexpr int kScaleCells = 5;      // Half an octave each, centred at -1 .. +1.
  static constexpr double kRotationStepRad = 0.08726646259971647;
  static constexpr double kScaleStep = 0.5;
  static constexpr double kDefaultCommonCause = 0.7;

  PredictedSuccess();  // The shipped default (no trials).
  static PredictedSuccess Fit(const std::vector<PredictionSample>& samples, Source source, double prior_count = 4.0);

  // p(o|theta, s), bilinear between cell centres, non-increasing in theta; 0 from 90 degrees on (nothing learned is in view).
  // Beyond the grid of scales, where nothing was tried, it falls linearly to 0 at two octaves.
  double Probability(double rotation_rad, double log2_scale = 0.0) const;

  // Rotation at which the probability at learned scale falls to one half, radians.
  double HalfwayRotation() const;

  Source source() const { return source_; }
  int trials() const;
  double prior_count() const { return prior_count_; }
  // Where several learned views are on offer: the share of failures that come to all of them at once, [0, 1] (see
  // CompletenessRule).
  double common_cause() const { return common_cause_; }
  // Throws std::invalid_argument where it is not in [0, 1].
  void set_common_cause(double share);
  // Counts per cell, index rotation_cell * kScaleCells + scale_cell. A trial between cell centres counts for each in part.
  const std::vector<double>& trial_counts() const { return trials_; }
  const std::vector<double>& success_counts() const { return successes_; }
  // From stored counts (both kRotationCells * kScaleCells long, 0 <= success <= trial). Throws std::invalid_argument.
  static PredictedSuccess FromCounts(std::vector<double> trials, std::vector<double> successes, Source source,
                                     double prior_count = 4.0);

 private:
  PredictedSuccess(std::vector<double> trials, std::vector<double> successes, Source source, double prior_count);

  std::vector<double> trials_;
  std::vector<double> successes_;
  std::vector<double> table_;  // Smoothed and monotone probability per cell.
  double prior_count_ = 4.0;
  double common_cause_ = kDefaultCommonCause;
  Source source_ = Source::kDefault;
};

}  // namespace vantage::measures
