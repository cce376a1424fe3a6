// How well probabilities hold: Brier score, calibration error, reliability.
#pragma once

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

}  // namespace vantage::measures
