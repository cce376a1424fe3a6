#include "measures/calibration.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>

namespace vantage::measures {
namespace {

void CheckResampling(int resamples, double level) {
  if (resamples < 1) throw std::invalid_argument("bootstrap: resamples must be >= 1");
  if (!(level > 0.0 && level < 1.0)) throw std::invalid_argument("bootstrap: level must be in (0, 1)");
}

// Below `count`.
std::size_t DrawIndex(std::size_t count, std::mt19937* random) { return static_cast<std::uint64_t>((*random)()) * count >> 32; }

Interval MiddleOf(std::vector<double> values, double level) {
  std::sort(values.begin(), values.end());
  const auto at = [&](double share) {
    return values[static_cast<std::size_t>(std::lround(share * (static_cast<double>(values.size()) - 1.0)))];
  };
  return {at(0.5 * (1.0 - level)), at(0.5 * (1.0 + level))};
}

}  // namespace

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
  CheckResampling(resamples, level);
  if (groups.empty()) return {};
  std::mt19937 random(seed);
  std::vector<double> values;
  for (int i = 0; i < resamples; ++i) {
    std::vector<Forecast> drawn;
    for (std::size_t k = 0; k < groups.size(); ++k) {
      const auto& group = groups[DrawIndex(groups.size(), &random)];
      drawn.insert(drawn.end(), group.begin(), group.end());
    }
    values.push_back(statistic(drawn));
  }
  return MiddleOf(std::move(values), level);
}

Interval BootstrapMeanInterval(const std::vector<std::vector<double>>& table, int resamples, double level, std::uint32_t seed) {
  CheckResampling(resamples, level);
  for (const auto& row : table) {
    if (row.size() != table.front().size()) throw std::invalid_argument("BootstrapMeanInterval: rows must be equally long");
  }
  if (table.empty() || table.front().empty()) return {};
  const std::size_t rows = table.size(), columns = table.front().size();
  std::mt19937 random(seed);
  std::vector<double> values;
  for (int i = 0; i < resamples; ++i) {
    std::vector<std::size_t> drawn(columns);
    for (std::size_t& column : drawn) column = DrawIndex(columns, &random);
    double sum = 0.0;
    for (std::size_t k = 0; k < rows; ++k) {
      const std::vector<double>& row = table[DrawIndex(rows, &random)];
      for (const std::size_t column : drawn) sum += row[column];
    }
    values.push_back(sum / static_cast<double>(rows * columns));
  }
  return MiddleOf(std::move(values), level);
}

}  // namespace vantage::measures
