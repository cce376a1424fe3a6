#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "features/features.h"
#include "features/inner_products.h"

namespace vantage::features {
namespace {

constexpr int kQueryRows = kProductColumns;  // Query rows that share one pass over the train rows.
constexpr int kTrainRows = kProductRows;     // Train rows per step.

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
  if (query.type() != CV_32F || train.type() != CV_32F || query.cols != train.cols) {
    throw std::invalid_argument("features: descriptors must be CV_32F rows of one length; found " + std::to_string(query.cols) +
                                " and " + std::to_string(train.cols));
  }
  if (!groups.empty() && static_cast<int>(groups.size()) != train.rows) {
    throw std::invalid_argument("features: groups must name every train row");
  }
  const int length = query.cols;
  std::vector<float> queries(static_cast<size_t>(kQueryRows) * length);
  float products[kTrainRows * kQueryRows];
  for (int start = 0; start < query.rows; start += kQueryRows) {
    const int count = std::min(kQueryRows, query.rows - start);
    for (int q = 0; q < count; ++q) {
      const float* row = query.ptr<float>(start + q);
      for (int i = 0; i < length; ++i) queries[i * kQueryRows + q] = row[i];
    }
    BestTwo best[kQueryRows];
    for (int row = 0; row < train.rows; row += kTrainRows) {
      const float* rows[kTrainRows];
      for (int t = 0; t < kTrainRows; ++t) rows[t] = train.ptr<float>(std::min(row + t, train.rows - 1));
      InnerProducts(queries.data(), rows, length, products);
      for (int t = 0; t < std::min(kTrainRows, train.rows - row); ++t) {
        for (int q = 0; q < count; ++q) best[q].Offer(row + t, products[t * kQueryRows + q], groups);
      }
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
