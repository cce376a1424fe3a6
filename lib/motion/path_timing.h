// Time-optimal traversal of a path u in [0, end]: what camera and joint paths share. Internal to motion.
//
// The path is cut into cells of constant derivatives by u; a Cell has `piece`, `begin_s` and `length_s` (of u), a Piece has
// `stop_at_end`. Within a cell (du/dt)^2 is linear in u, so d2u/dt2 is constant.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace vantage::motion {

// (du/dt)^2 at the borders of the cells, at rest at both ends: as fast as the limits allow. `cap(cell)`: the largest (du/dt)^2 in a
// cell. `largest_change(cell, squared_rate, sign)`: the largest |d2u/dt2| >= 0 towards that sign. At least one cell.
template <typename Piece, typename Cell, typename Cap, typename LargestChange>
std::vector<double> SquaredRates(const std::vector<Piece>& pieces, const std::vector<Cell>& cells, const Cap& cap,
                                 const LargestChange& largest_change) {
  std::vector<double> rates(cells.size() + 1, 1.0);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const double most = cap(cells[i]);
    rates[i] = std::min(rates[i], most);
    rates[i + 1] = std::min(rates[i + 1], most);
    const bool ends_piece = i + 1 == cells.size() || cells[i + 1].piece != cells[i].piece;
    if (ends_piece && pieces[cells[i].piece].stop_at_end) rates[i + 1] = 0.0;
  }
  rates.front() = rates.back() = 0.0;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    rates[i + 1] = std::min(rates[i + 1], rates[i] + 2.0 * cells[i].length_s * largest_change(cells[i], rates[i], 1.0));
  }
  for (std::size_t i = cells.size(); i-- > 0;) {
    rates[i] = std::min(rates[i], rates[i + 1] + 2.0 * cells[i].length_s * largest_change(cells[i], rates[i + 1], -1.0));
  }
  return rates;
}

// The times strictly between start and end, evenly `longest_interval_s` apart at most: `add(time_s, cell, u)` for each. Returns the
// end, seconds.
template <typename Cell, typename Add>
double SampleEvenly(const std::vector<Cell>& cells, const std::vector<double>& squared_rates, double longest_interval_s,
                    const Add& add) {
  std::vector<double> times(cells.size() + 1, 0.0);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    times[i + 1] = times[i] + 2.0 * cells[i].length_s / (std::sqrt(squared_rates[i]) + std::sqrt(squared_rates[i + 1]));
  }
  const int intervals = std::max(1, static_cast<int>(std::ceil(times.back() / longest_interval_s - 1e-9)));
  std::size_t i = 0;
  for (int k = 1; k < intervals; ++k) {
    const double time_s = times.back() * k / intervals;
    while (i + 1 < cells.size() && times[i + 1] <= time_s) ++i;
    const double since_s = time_s - times[i];
    const double change = (squared_rates[i + 1] - squared_rates[i]) / (2.0 * cells[i].length_s);
    add(time_s, cells[i], cells[i].begin_s + std::sqrt(squared_rates[i]) * since_s + change * since_s * since_s / 2.0);
  }
  return times.back();
}

}  // namespace vantage::motion
