// How well probabilities hold: Brier score, calibration error, reliability.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

namespace vantage::measures {

// What was claimed and what came of it.
struct Forecast {
  double probability = 0.0;  // [0, 1].
  bool outcome = false;
};

// Mean squared difference between probability and outcome: 0 is perfect, 1/4 is what "always one half" gets. 0 without forecasts.
double BrierScore(const std::vector<Forecast>& forecasts);

struct ReliabilityBin {
  double mean_probability = 0.0;
  double frequency = 0.0;  // Share of true outcomes.
  int count = 0;
};

// Forecasts by rising probability in at most `bins` groups of about equal size; equal probabilities are never parted (so there may
// be fewer groups). Throws std::invalid_argument where bins < 1. Cost: one sort.
std::vector<ReliabilityBin> Reliability(std::vector<Forecast> forecasts, int bins = 10);

// Expected calibration error: mean |probability - frequency| over the reliability bins, weighted by count. 0 without forecasts.
double CalibrationError(const std::vector<Forecast>& forecasts, int bins = 10);

struct Interval {
  double lower = 0.0;
  double upper = 0.0;
};

// Percentile bootstrap of a statistic over groups (Efron, 1979): forecasts of one frame err together, so whole frames are drawn,
// with replacement, as many as there are. Holds `level` of the resampled values in its middle. Deterministic in `seed`; {0, 0}
// without groups. Throws std::invalid_argument where resamples < 1 or level is not in (0, 1). Cost: the statistic, `resamples`
// times.
Interval BootstrapInterval(const std::vector<std::vector<Forecast>>& groups,
                           const std::function<double(const std::vector<Forecast>&)>& statistic, int resamples = 1000,
                           double level = 0.95, std::uint32_t seed = 0);

// Likewise of the mean of a table, all rows equally long, where both rows (models, say) and columns (frames that all of them were
// judged on) are samples: both are drawn anew (Owen, 2007: rather too wide than too narrow). {0, 0} for an empty table. Throws also
// where rows differ in length.
Interval BootstrapMeanInterval(const std::vector<std::vector<double>>& table, int resamples = 1000, double level = 0.95,
                               std::uint32_t seed = 0);

}  // namespace vantage::measures
