#include "features/inner_products.h"

namespace vantage::features {
namespace {

constexpr int kLanes = kProductColumns / 2;  // Floats a vector register holds: one per column.

typedef float Lanes __attribute__((vector_size(kLanes * sizeof(float)), aligned(4)));

}  // namespace

// The compiler makes one version for AVX2 and one for any machine, and picks at run time.
__attribute__((target_clones("arch=x86-64-v3", "default"))) void InnerProducts(const float* columns, const float* const* rows,
                                                                               int length, float* products) {
  Lanes low[kProductRows] = {}, high[kProductRows] = {};
  for (int i = 0; i < length; ++i) {
    const Lanes c_low = *reinterpret_cast<const Lanes*>(columns + i * kProductColumns);
    const Lanes c_high = *reinterpret_cast<const Lanes*>(columns + i * kProductColumns + kLanes);
    for (int r = 0; r < kProductRows; ++r) {
      low[r] += c_low * rows[r][i];
      high[r] += c_high * rows[r][i];
    }
  }
  for (int r = 0; r < kProductRows; ++r) {
    *reinterpret_cast<Lanes*>(products + r * kProductColumns) = low[r];
    *reinterpret_cast<Lanes*>(products + r * kProductColumns + kLanes) = high[r];
  }
}

__attribute__((target_clones("arch=x86-64-v3", "default"))) void InnerProductsOfOne(const float* columns, const float* row,
                                                                                    int length, float* products) {
  constexpr int kParts = 4;  // Sums that do not wait for each other.
  Lanes low[kParts] = {}, high[kParts] = {};
  int i = 0;
  for (; i + kParts <= length; i += kParts) {
    for (int p = 0; p < kParts; ++p) {
      low[p] += *reinterpret_cast<const Lanes*>(columns + (i + p) * kProductColumns) * row[i + p];
      high[p] += *reinterpret_cast<const Lanes*>(columns + (i + p) * kProductColumns + kLanes) * row[i + p];
    }
  }
  for (; i < length; ++i) {
    low[0] += *reinterpret_cast<const Lanes*>(columns + i * kProductColumns) * row[i];
    high[0] += *reinterpret_cast<const Lanes*>(columns + i * kProductColumns + kLanes) * row[i];
  }
  *reinterpret_cast<Lanes*>(products) = (low[0] + low[1]) + (low[2] + low[3]);
  *reinterpret_cast<Lanes*>(products + kLanes) = (high[0] + high[1]) + (high[2] + high[3]);
}

__attribute__((target_clones("arch=x86-64-v3", "default"))) float SquaredDistance(const float* a, const float* b, int length) {
  constexpr int kParts = 8;
  float parts[kParts] = {};
  int i = 0;
  for (; i + kParts <= length; i += kParts) {
    for (int p = 0; p < kParts; ++p) parts[p] += (a[i + p] - b[i + p]) * (a[i + p] - b[i + p]);
  }
  float sum = 0.f;
  for (; i < length; ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  for (const float part : parts) sum += part;
  return sum;
}

}  // namespace vantage::features
