#include "recognition/codes.h"

#include <algorithm>
#include <cmath>

namespace vantage::recognition {
namespace {

template <typename Code>
void Round(const float* row, int length, Code* code) {
  for (int i = 0; i < length; ++i) {
    const float value = std::min(127.f, std::max(-127.f, row[i] * kCodeScale));
    code[i] = static_cast<Code>(value + (value < 0.f ? -0.5f : 0.5f));
  }
}

}  // namespace

void Encode(const float* row, int length, std::int8_t* code) { Round(row, length, code); }
void Encode(const float* row, int length, std::int16_t* code) { Round(row, length, code); }

void Decode(const std::int8_t* code, int length, float* row) {
  for (int i = 0; i < length; ++i) row[i] = code[i] / kCodeScale;
}

__attribute__((target_clones("arch=x86-64-v3", "default"))) void CodeProducts(const std::int16_t* query, const std::int8_t* codes,
                                                                              int count, int length, std::int32_t* products) {
  for (int p = 0; p < count; ++p, codes += length) {
    std::int32_t sum = 0;
    for (int i = 0; i < length; ++i) sum += query[i] * codes[i];
    products[p] = sum;
  }
}

float CodeDistance(std::int32_t product) {
  const float cosine = product / (kCodeScale * kCodeScale);
  return std::sqrt(std::max(0.f, 2.f - 2.f * cosine));
}

}  // namespace vantage::recognition
