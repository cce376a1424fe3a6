#include "recognition/kmeans.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "features/inner_products.h"

namespace vantage::recognition {
namespace {

constexpr int kBlock = features::kProductColumns;
static_assert(kComparedRows == features::kProductRows);

// Stands for the norm of a centroid that is not there; finite, so that sums with it stay numbers.
constexpr float kNever = std::numeric_limits<float>::max() / 4;

std::size_t BlockFloats(int length) { return static_cast<std::size_t>(kBlock) * (length + 1); }

double Uniform(std::mt19937& random) { return random() / 4294967296.0; }

// Rows drawn evenly, in their order.
std::vector<const float*> Sample(const float* const* rows, std::size_t row_count, std::size_t wanted, std::mt19937& random) {
  if (row_count <= wanted) return std::vector<const float*>(rows, rows + row_count);
  std::vector<const float*> sample(wanted);
  const double step = static_cast<double>(row_count) / static_cast<double>(wanted);
  for (std::size_t i = 0; i < wanted; ++i) {
    const auto at = static_cast<std::size_t>((static_cast<double>(i) + Uniform(random)) * step);
    sample[i] = rows[std::min(at, row_count - 1)];
  }
  return sample;
}

// k-means++ (Arthur and Vassilvitskii, 2007): a row is the next centroid with a probability that rises with its squared distance to
// those there are.
std::vector<float> FirstCentroids(const std::vector<const float*>& rows, int length, int clusters, std::mt19937& random) {
  std::vector<float> centroids;
  std::vector<double> distance(rows.size(), std::numeric_limits<double>::max());
  std::size_t next = static_cast<std::size_t>(Uniform(random) * static_cast<double>(rows.size()));
  for (int c = 0; c < clusters; ++c) {
    centroids.insert(centroids.end(), rows[next], rows[next] + length);
    double sum = 0.0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      distance[i] = std::min<double>(distance[i], features::SquaredDistance(rows[i], rows[next], length));
      sum += distance[i];
    }
    if (sum <= 0.0) break;  // Every row is a centroid.
    double left = Uniform(random) * sum;
    next = 0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (distance[i] <= 0.0) continue;
      next = i;
      left -= distance[i];
      if (left < 0.0) break;
    }
  }
  return centroids;
}

// The means of the rows assigned to each centroid; those without rows are dropped.
std::vector<float> Means(const std::vector<const float*>& rows, const std::vector<int>& nearest, int clusters, int length) {
  std::vector<float> sums(static_cast<std::size_t>(clusters) * length, 0.f);
  std::vector<int> counts(clusters, 0);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    float* sum = sums.data() + static_cast<std::size_t>(nearest[i]) * length;
    for (int j = 0; j < length; ++j) sum[j] += rows[i][j];
    ++counts[nearest[i]];
  }
  std::vector<float> means;
  for (int c = 0; c < clusters; ++c) {
    const float* sum = sums.data() + static_cast<std::size_t>(c) * length;
    for (int j = 0; counts[c] > 0 && j < length; ++j) means.push_back(sum[j] / static_cast<float>(counts[c]));
  }
  return means;
}

}  // namespace

int PaddedCount(int count) { return (count + kBlock - 1) / kBlock * kBlock; }

std::size_t PackedFloats(int count, int length) {
  return static_cast<std::size_t>(PaddedCount(count) / kBlock) * BlockFloats(length);
}

void PackCentroids(const float* centroids, int count, int length, float* packed) {
  std::fill_n(packed, PackedFloats(count, length), 0.f);
  for (int c = 0; c < PaddedCount(count); ++c) {
    float* block = packed + static_cast<std::size_t>(c / kBlock) * BlockFloats(length);
    float& half_norm = block[kBlock * length + c % kBlock];
    if (c >= count) {
      half_norm = kNever;
      continue;
    }
    for (int i = 0; i < length; ++i) {
      const float value = centroids[static_cast<std::size_t>(c) * length + i];
      block[i * kBlock + c % kBlock] = value;
      half_norm += 0.5f * value * value;
    }
  }
}

void UnpackCentroids(const float* packed, int count, int length, float* centroids) {
  for (int c = 0; c < count; ++c) {
    const float* block = packed + static_cast<std::size_t>(c / kBlock) * BlockFloats(length);
    for (int i = 0; i < length; ++i) centroids[static_cast<std::size_t>(c) * length + i] = block[i * kBlock + c % kBlock];
  }
}

void CompareWithCentroids(const float* packed, int count, int length, const float* const* rows, int row_count, float* excess) {
  const float* four[kComparedRows];
  for (int r = 0; r < kComparedRows; ++r) four[r] = rows[std::min(r, row_count - 1)];
  float products[kComparedRows * kBlock];
  const int padded = PaddedCount(count);
  for (int start = 0; start < count; start += kBlock) {
    if (row_count == 1) {
      features::InnerProductsOfOne(packed, rows[0], length, products);
    } else {
      features::InnerProducts(packed, four, length, products);
    }
    const float* half_norms = packed + kBlock * length;
    for (int r = 0; r < row_count; ++r) {
      for (int c = 0; c < kBlock; ++c) excess[r * padded + start + c] = half_norms[c] - products[r * kBlock + c];
    }
    packed += BlockFloats(length);
  }
}

void AssignToCentroids(const float* packed, int count, int length, const float* const* rows, std::size_t row_count, int* nearest) {
  const int padded = PaddedCount(count);
  std::vector<float> excess(static_cast<std::size_t>(kComparedRows) * padded);
  for (std::size_t start = 0; start < row_count; start += kComparedRows) {
    const int now = static_cast<int>(std::min<std::size_t>(kComparedRows, row_count - start));
    CompareWithCentroids(packed, count, length, rows + start, now, excess.data());
    for (int r = 0; r < now; ++r) {
      const float* row = excess.data() + static_cast<std::size_t>(r) * padded;
      nearest[start + r] = static_cast<int>(std::min_element(row, row + count) - row);
    }
  }
}

std::vector<float> KMeans(const float* const* rows, std::size_t row_count, int length, const KMeansParams& params,
                          std::mt19937& random) {
  if (row_count == 0) return {};
  const auto wanted = static_cast<std::size_t>(params.clusters) * params.rows_per_cluster;
  const std::vector<const float*> sample = Sample(rows, row_count, wanted, random);
  std::vector<float> centroids = FirstCentroids(sample, length, params.clusters, random);
  std::vector<int> nearest(sample.size()), before;
  std::vector<float> packed;
  for (int i = 0; i < params.iterations; ++i) {
    const int clusters = static_cast<int>(centroids.size() / length);
    packed.resize(PackedFloats(clusters, length));
    PackCentroids(centroids.data(), clusters, length, packed.data());
    AssignToCentroids(packed.data(), clusters, length, sample.data(), sample.size(), nearest.data());
    if (nearest == before) break;
    before = nearest;
    centroids = Means(sample, nearest, clusters, length);
  }
  return centroids;
}

}  // namespace vantage::recognition
