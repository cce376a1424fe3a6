// Inner products and distances of rows: where matching and the vocabulary tree spend their time.
#pragma once

namespace vantage::features {

constexpr int kProductColumns = 16;  // Two registers.
constexpr int kProductRows = 4;      // 2 x 4 sums stay in registers.

// products[r * 16 + c] = sum over i < length of rows[r][i] * columns[i * 16 + c]: 4 rows with 16 columns, the columns given value
// by value (value i of all of them, then value i + 1), so that no sum runs across a register. No alignment is asked for. AVX2 where
// the machine has it (chosen at run time). Cost: about length / 2 ns.
void InnerProducts(const float* columns, const float* const* rows, int length, float* products);

// The same for one row; rounded differently. Cost: about length / 5 ns.
void InnerProductsOfOne(const float* columns, const float* row, int length, float* products);

// |a - b|^2. Cost: about length / 6 ns.
float SquaredDistance(const float* a, const float* b, int length);

}  // namespace vantage::features
