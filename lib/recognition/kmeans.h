// k-means, and a few centroids packed so that a row is compared with all of them at once.
#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

namespace vantage::recognition {

// How `count` centroids of `length` values lie in memory: blocks of 16, each value by value with half the squared norms behind
// them. The last block is filled up with centroids that are never the nearest.
int PaddedCount(int count);                                                          // The next multiple of 16.
std::size_t PackedFloats(int count, int length);                                     // Floats of the packed centroids.
void PackCentroids(const float* centroids, int count, int length, float* packed);    // From count x length, row by row.
void UnpackCentroids(const float* packed, int count, int length, float* centroids);  // And back.

constexpr int kComparedRows = 4;  // Rows that one pass over the centroids serves.

// excess[r * PaddedCount(count) + c] = |c|^2 / 2 - row_r . c for up to 4 rows: half the squared distance but for |row_r|^2 / 2, so
// values of one row can be compared, over different sets of centroids too.
void CompareWithCentroids(const float* packed, int count, int length, const float* const* rows, int row_count, float* excess);

// The nearest centroid of every row; the first of equals.
void AssignToCentroids(const float* packed, int count, int length, const float* const* rows, std::size_t row_count, int* nearest);

struct KMeansParams {
  int clusters = 16;
  int iterations = 8;          // Of Lloyd's.
  int rows_per_cluster = 128;  // Only so many rows, drawn evenly, are looked at.
};

// Centroids (at most `clusters`, row by row, none empty on the rows looked at) by k-means++ and Lloyd's iterations; fewer than two
// where all rows are alike. Deterministic in `random`. Cost: iterations x clusters distances for each row looked at.
std::vector<float> KMeans(const float* const* rows, std::size_t row_count, int length, const KMeansParams& params,
                          std::mt19937& random);

}  // namespace vantage::recognition
