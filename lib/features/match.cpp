#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "features/features.h"

namespace vantage::features {
namespace {

constexpr int kBlock = 8;  // Query rows that share one pass over the train rows.
constexpr int kLanes = 8;  // Floats a vector register holds.

typedef float Lanes __attribute__((vector_size(kLanes * sizeof(float)), aligned(4)));

// Inner products of kBlock query rows (contiguous, `length` apart) with one train row.
// The compiler makes one version for AVX2 and one for any machine, and picks at run time.
__attribute__((target_clones("arch=haswell", "default"))) void InnerProducts(const float* query, const float* train, int length,
                                                                             float* products) {
  Lanes sums[kBlock] = {};
  for (int i = 0; i < length; i += kLanes) {
    const Lanes t = *reinterpret_cast<const Lanes*>(train + i);
    for (int q = 0; q < kBlock; ++q) sums[q] += *reinterpret_cast<const Lanes*>(query + q * length + i) * t;
  }
  for (int q = 0; q < kBlock; ++q) {
    float sum = 0.f;
    for (int lane = 0; lane < kLanes; ++lane) sum += sums[q][lane];
    products[q] = sum;
  }
}

struct BestTwo {
  int best = -1, second = -1;
  float best_product = -2.f, second_product = -2.f;

  void Offer(int row, float product, const std::vector<int>& groups) {
    if (product <= second_product && product <= best_product) return;
    const bool same_group = best >= 0 && !groups.empty() && groups[row] == groups[best];
    if (product > best_product) {
      if (!same_group) {
        second = best;
        second_product = best_product;
      }
      best = row;
      best_product = product;
    } else if (!same_group) {
      second = row;
      second_product = product;
    }
  }
};

float Distance(float product) { return std::sqrt(std::max(0.f, 2.f - 2.f * product)); }

}  // namespace

std::vector<NearestPair> NearestTwo(const cv::Mat& query, const cv::Mat& train, const std::vector<int>& groups) {
  std::vector<NearestPair> nearest(query.rows);
  if (query.rows == 0 || train.rows == 0) return nearest;
  if (query.type() != CV_32F || train.type() != CV_32F || query.cols != train.cols || query.cols % kLanes != 0) {
    throw std::invalid_argument("features: descriptors must be CV_32F rows of one length, a multiple of 8; found " +
                                std::to_string(query.cols) + " and " + std::to_string(train.cols));
  }
  if (!groups.empty() && static_cast<int>(groups.size()) != train.rows) {
    throw std::invalid_argument("features: groups must name every train row");
  }
  const int length = query.cols;
  std::vector<float> block(static_cast<size_t>(kBlock) * length);
  float products[kBlock];
  for (int start = 0; start < query.rows; start += kBlock) {
    const int count = std::min(kBlock, query.rows - start);
    for (int q = 0; q < count; ++q) std::copy_n(query.ptr<float>(start + q), length, block.data() + q * length);
    BestTwo best[kBlock];
    for (int row = 0; row < train.rows; ++row) {
      InnerProducts(block.data(), train.ptr<float>(row), length, products);
      for (int q = 0; q < count; ++q) best[q].Offer(row, products[q], groups);
    }
    for (int q = 0; q < count; ++q) {
      NearestPair& pair = nearest[start + q];
      pair.best = best[q].best;
      pair.second = best[q].second;
      if (pair.best >= 0) pair.best_distance = Distance(best[q].best_product);
      if (pair.second >= 0) pair.second_distance = Distance(best[q].second_product);
    }
  }
  return nearest;
}

std::vector<Match> MatchRatio(const cv::Mat& query, const cv::Mat& train, double max_ratio, double max_distance) {
  std::vector<Match> matches;
  const std::vector<NearestPair> nearest = NearestTwo(query, train);
  for (size_t i = 0; i < nearest.size(); ++i) {
    const NearestPair& pair = nearest[i];
    if (pair.best >= 0 && pair.best_distance < max_distance && pair.best_distance < max_ratio * pair.second_distance) {
      matches.push_back({static_cast<int>(i), pair.best, pair.best_distance});
    }
  }
  return matches;
}

}  // namespace vantage::features
