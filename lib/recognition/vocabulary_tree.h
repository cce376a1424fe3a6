// The vocabulary tree: a hierarchical quantisation of descriptors (section IV-A; Nister and Stewenius, 2006) that grows in place.
#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace vantage::recognition {

struct VocabularyParams {
  int branching = 16;  // k: children of a node; [2, 256]. Multiples of 16 use the machine best.
  int depth = 5;       // Levels of children that training makes; [1, 12].
  int iterations = 8;  // Of k-means, per node; >= 1.
  std::uint32_t seed = 0;

  void Check() const;  // Throws std::invalid_argument naming the field.
};

// The leaves that rows fall into: `paths` per row, nearest centroid first, -1 where there are no more.
struct Words {
  int paths = 1;
  std::vector<int> leaves;  // rows x paths.

  int rows() const { return static_cast<int>(leaves.size()) / paths; }
  const int* of(int row) const { return leaves.data() + static_cast<std::size_t>(row) * paths; }
};

// Leaves are numbered from 0 without gaps, and keep their numbers: a leaf that is split hands its number to one of its parts.
class VocabularyTree {
 public:
  // One leaf. `descriptor` names the kind of descriptors ("sift"): a vocabulary is of no use to another. `length`: their values.
  VocabularyTree(const std::string& descriptor, int length, const VocabularyParams& params);

  // Hierarchical k-means. `progress` (may be empty) is called with the share done. The same whatever the number of threads.
  // descriptors  CV_32F rows of one length, at least one; throws std::invalid_argument otherwise.
  // Cost: branching x depth distances a row; memory: 8 bytes a row beside the tree.
  static VocabularyTree Train(const std::string& descriptor, const cv::Mat& descriptors, const VocabularyParams& params,
                              const std::function<void(double)>& progress = {});

  const std::string& descriptor() const { return descriptor_; }
  int length() const { return length_; }
  const VocabularyParams& params() const { return params_; }
  int leaves() const { return static_cast<int>(leaf_nodes_.size()); }
  int nodes() const { return static_cast<int>(nodes_.size()); }
  std::size_t memory_bytes() const;

  // The leaves of every row, following the `paths` nearest nodes of each level (greedy N-best paths, Schindler et al., 2007).
  // Throws std::invalid_argument where the rows are not CV_32F of our length.
  // Cost: paths x branching x depth distances a row.
  Words Quantise(const cv::Mat& descriptors, int paths = 1) const;

  // Makes a node of a leaf, with children by k-means over `descriptors` (CV_32F rows that fell into it). Returns the node; -1, and
  // nothing changed, where they cannot be told apart. Other leaves stay as they are.
  int Split(int leaf, const cv::Mat& descriptors);
  // The leaf of every row among the children of a node that Split made: what Quantise says of rows that reach it.
  std::vector<int> LeavesUnder(int node, const cv::Mat& descriptors) const;

  // Writes another file, then renames it: FILE is whole or as it was. Throws std::runtime_error naming the file.
  void Save(const std::filesystem::path& file) const;
  // Throws std::runtime_error, one line with what was expected and found and what to do: no such file, not a vocabulary, damaged,
  // or of another descriptor than `descriptor` of `length` values ("" and 0 = any).
  static VocabularyTree Load(const std::filesystem::path& file, const std::string& descriptor = "", int length = 0);
  // Throws as Load does, but looks at the file's size and header only: what is damaged inside, Load finds.
  static void CheckFile(const std::filesystem::path& file, const std::string& descriptor);

 private:
  struct Node {
    std::int32_t first_child = 0;  // Children are neighbours.
    std::int32_t children = 0;     // 0: a leaf.
    std::int32_t block = -1;       // Where the children's centroids begin.
    std::int32_t leaf = -1;
    std::int32_t depth = 0;
  };

  VocabularyTree() = default;
  const float* Centroids(int block) const;
  float* Centroids(int block);
  void NearestChildren(int node, const cv::Mat& descriptors, const int* rows, std::size_t count, int* nearest) const;
  void FollowNearest(const cv::Mat& descriptors, int* leaves) const;
  int AddBlocks(int count);  // For so many centroids, in one piece.
  void AddChildren(int node, const float* centroids, int count);
  std::vector<float> Divide(int node, const float* const* rows, std::size_t row_count) const;  // Centroids of its parts.
  friend class VocabularyReader;

  std::string descriptor_;
  int length_ = 0;
  VocabularyParams params_;
  // Nothing here is moved when more comes: growth costs the same at any size.
  std::deque<Node> nodes_;
  std::deque<std::int32_t> leaf_nodes_;
  std::vector<cv::Mat> chunks_;  // Packed centroids, kChunkBlocks blocks of 16 each.
  int blocks_ = 0;
};

}  // namespace vantage::recognition
