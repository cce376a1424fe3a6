// Descriptors in 8 bits a value, as the leaves of an inverted file keep them.
#pragma once

#include <cstdint>

namespace vantage::recognition {

constexpr float kCodeScale = 127 / 0.7f;  // Unit rows of 64 or 128 values hardly hold one beyond 0.7.

// Of a row of `length` values, rounded; values beyond 0.7 are cut off. The wider kind is for queries, which are multiplied.
void Encode(const float* row, int length, std::int8_t* code);
void Encode(const float* row, int length, std::int16_t* code);
void Decode(const std::int8_t* code, int length, float* row);

// products[p] = inner product of the query and the p-th of `count` codes, which lie one after the other. Cost: about length / 10 ns
// each.
void CodeProducts(const std::int16_t* query, const std::int8_t* codes, int count, int length, std::int32_t* products);

// Euclidean distance of two unit rows whose codes have this product; +-0.02.
float CodeDistance(std::int32_t product);

}  // namespace vantage::recognition
