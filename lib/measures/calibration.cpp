#include "measures/calibration.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>

namespace vantage::measures {

double BrierScore(const std::vector<Forecast>& forecasts) {
  if (forecasts.empty()) return 0.0;
  double sum = 0.0;
  for (const Forecast& forecast : forecasts) sum += std::pow(forecast.probability - (forecast.outcome ? 1.0 : 0.0), 2);
  return sum / static_cast<double>(forecasts.size());
}

std::vector<ReliabilityBin> Reliability(std::vector<Forecast> forecasts, int bins) {
  if (bins < 1) throw std::invalid_argument("Reliability: bins must be >= 1");
  std::sort(forecasts.begin(), forecasts.end(), [](const Forecast& a, const Forecast& b) { return a.probability < b.probability; });
  std::vector<ReliabilityBin> table;
  std::size_t begin = 0;
  for (int bin = 1; bin <= bins; ++bin) {
    std::size_t end = forecasts.size() * static_cast<std::size_t>(bin) / static_cast<std::size_t>(bins);
    if (end <= begin) continue;
    while (end < forecasts.size() && forecasts[end].probability == forecasts[end - 1].probability) ++end;
    ReliabilityBin entry;
    entry.count = static_cast<int>(end - begin);
    for (std::size_t i = begin; i < end; ++i) {
      entry.mean_probability += forecasts[i].probability / entry.count;
      entry.frequency += (forecasts[i].outcome ? 1.0 : 0.0) / entry.count;
    }
    table.push_back(entry);
    begin = end;
  }
  return table;
}

double CalibrationError(const std::vector<Forecast>& forecasts, int bins) {
  double error = 0.0;
  for (const ReliabilityBin& bin : Reliability(forecasts, bins)) {
    error += bin.count * std::abs(bin.mean_probability - bin.frequency) / static_cast<double>(forecasts.size());
  }
  return error;
}

Interval BootstrapInterval(const std::vector<std::vector<Forecast>>& groups,
                           const std::function<double(const std::vector<Forecast>&)>& statistic, int resamples, double level,
                           std::uint32_t seed) {
  if (resamples < 1) throw std::invalid_argument("BootstrapInterval: resamples must be >= 1");
  if (!(level > 0.0 && level < 1.0)) throw std::invalid_argument("BootstrapInterval: level must be in (0, 1)");
  if (groups.empty()) return {};
  std::mt19937 random(seed);
  std::vector<double> values;
  for (int i = 0; i < resamples; ++i) {
    std::vector<Forecast> drawn;
    for (std::size_t k = 0; k < groups.size(); ++k) {
      const auto& group = groups[static_cast<std::uint64_t>(random()) * groups.size() >> 32];
      drawn.insert(drawn.end(), group.begin(), group.end());
    }
    values.push_back(statistic(drawn));
  }
  std::sort(values.begin(), values.end());
  const auto at = [&](double share) { return values[static_cast<std::size_t>(std::lround(share * (resamples - 1)))]; };
  return {at(0.5 * (1.0 - level)), at(0.5 * (1.0 + level))};
}

}  // namespace vantage::measures
