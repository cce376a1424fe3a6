// Descriptors made up for tests of the vocabulary.
#pragma once

#include <cmath>
#include <functional>
#include <opencv2/core.hpp>
#include <random>
#include <string>

#include "recognition/vocabulary_tree.h"

namespace vantage::recognition {

constexpr int kLength = 64;

inline void Normalise(cv::Mat row) { row /= std::max(1e-9, cv::norm(row)); }

inline float Normal(std::mt19937& random) {  // Sum of twelve uniforms less six.
  float sum = -6.f;
  for (int i = 0; i < 12; ++i) sum += static_cast<float>(random() / 4294967296.0);
  return sum;
}

inline cv::Mat RandomUnitRows(int rows, std::uint32_t seed, int length = kLength) {
  std::mt19937 random(seed);
  cv::Mat matrix(rows, length, CV_32F);
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < length; ++c) matrix.at<float>(r, c) = Normal(random);
    Normalise(matrix.row(r));
  }
  return matrix;
}

// The same rows, seen again: each moved by about `noise`.
inline cv::Mat SeenAgain(const cv::Mat& rows, double noise, std::uint32_t seed) {
  std::mt19937 random(seed);
  cv::Mat again = rows.clone();
  for (int r = 0; r < rows.rows; ++r) {
    for (int c = 0; c < rows.cols; ++c) again.at<float>(r, c) += static_cast<float>(noise / std::sqrt(rows.cols)) * Normal(random);
    Normalise(again.row(r));
  }
  return again;
}

inline VocabularyParams SmallTree() {
  VocabularyParams params;
  params.branching = 4;
  params.depth = 3;
  params.seed = 5;
  return params;
}

inline std::string ErrorOf(const std::function<void()>& call) {
  try {
    call();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

}  // namespace vantage::recognition
