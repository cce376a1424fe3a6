#include "recognition/vocabulary_tree.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <opencv2/core/utility.hpp>
#include <stdexcept>

#include "recognition/kmeans.h"

namespace vantage::recognition {
namespace {

constexpr int kBlock = 16;                    // Centroids of a block (PaddedCount).
constexpr int kChunkBlocks = 256;             // Blocks allocated at once: 1 MB for 64 values.
constexpr int kMaxDepth = 32;                 // A leaf down there stays one: its descriptors are as good as alike.
constexpr int kMinRowsPerChild = 2;           // Training makes no children for fewer rows each, on average.
constexpr std::size_t kParallelRows = 20000;  // From so many rows on, threads share them.

std::mt19937 RandomOf(std::uint32_t seed, int node) {
  return std::mt19937(seed * 2654435761u ^ static_cast<std::uint32_t>(node) * 2246822519u);
}

void CheckRows(const cv::Mat& descriptors, int length) {
  if (descriptors.rows == 0) return;
  if (descriptors.type() != CV_32F || (length > 0 && descriptors.cols != length)) {
    throw std::invalid_argument("vocabulary: descriptors must be CV_32F rows of " + std::to_string(length) + " values; found " +
                                cv::typeToString(descriptors.type()) + " of " + std::to_string(descriptors.cols));
  }
}

std::vector<const float*> RowPointers(const cv::Mat& descriptors) {
  std::vector<const float*> rows(descriptors.rows);
  for (int i = 0; i < descriptors.rows; ++i) rows[i] = descriptors.ptr<float>(i);
  return rows;
}

// AssignToCentroids on all cores; every row's answer is its own, so threads change nothing.
void AssignParallel(const float* packed, int count, int length, const float* const* rows, std::size_t row_count, int* nearest) {
  if (row_count < kParallelRows) return AssignToCentroids(packed, count, length, rows, row_count, nearest);
  const int pieces = static_cast<int>(row_count / (kParallelRows / 4));
  cv::parallel_for_(cv::Range(0, pieces), [&](const cv::Range& range) {
    const std::size_t begin = row_count * range.start / pieces, end = row_count * range.end / pieces;
    AssignToCentroids(packed, count, length, rows + begin, end - begin, nearest + begin);
  });
}

}  // namespace

void VocabularyParams::Check() const {
  const auto require = [](bool ok, const std::string& what) {
    if (!ok) throw std::invalid_argument("vocabulary: " + what);
  };
  require(branching >= 2 && branching <= 256, "branching must be in [2, 256], is " + std::to_string(branching));
  require(depth >= 1 && depth <= 12, "depth must be in [1, 12], is " + std::to_string(depth));
  require(iterations >= 1, "iterations must be >= 1, is " + std::to_string(iterations));
}

VocabularyTree::VocabularyTree(const std::string& descriptor, int length, const VocabularyParams& params)
    : descriptor_(descriptor), length_(length), params_(params) {
  params.Check();
  if (length < 1) throw std::invalid_argument("vocabulary: descriptors need at least one value");
  Node root;
  root.leaf = 0;
  nodes_.push_back(root);
  leaf_nodes_.push_back(0);
}

const float* VocabularyTree::Centroids(int block) const {
  return chunks_[block / kChunkBlocks].ptr<float>(0) +
         static_cast<std::size_t>(block % kChunkBlocks) * PackedFloats(kBlock, length_);
}

float* VocabularyTree::Centroids(int block) {
  return const_cast<float*>(static_cast<const VocabularyTree*>(this)->Centroids(block));
}

int VocabularyTree::AddBlocks(int count) {
  const int blocks = PaddedCount(count) / kBlock;
  const int left = static_cast<int>(chunks_.size()) * kChunkBlocks - blocks_;
  if (left < blocks) {
    blocks_ += left;
    const auto floats = static_cast<int>(kChunkBlocks * PackedFloats(kBlock, length_));
    chunks_.emplace_back(1, floats, CV_32F);
  }
  const int first = blocks_;
  blocks_ += blocks;
  return first;
}

void VocabularyTree::AddChildren(int node, const float* centroids, int count) {
  Node& parent = nodes_[node];
  parent.block = AddBlocks(count);
  PackCentroids(centroids, count, length_, Centroids(parent.block));
  parent.first_child = nodes();
  parent.children = count;
  for (int c = 0; c < count; ++c) {
    Node child;
    child.depth = nodes_[node].depth + 1;
    child.leaf = c == 0 ? nodes_[node].leaf : leaves();
    if (c == 0) {
      leaf_nodes_[child.leaf] = nodes();
    } else {
      leaf_nodes_.push_back(nodes());
    }
    nodes_.push_back(child);
  }
  nodes_[node].leaf = -1;
}

std::vector<float> VocabularyTree::Divide(int node, const float* const* rows, std::size_t row_count) const {
  std::mt19937 random = RandomOf(params_.seed, node);
  KMeansParams params;
  params.clusters = params_.branching;
  params.iterations = params_.iterations;
  return KMeans(rows, row_count, length_, params, random);
}

VocabularyTree VocabularyTree::Train(const std::string& descriptor, const cv::Mat& descriptors, const VocabularyParams& params,
                                     const std::function<void(double)>& progress) {
  if (descriptors.rows == 0) throw std::invalid_argument("vocabulary: no descriptors to train with");
  VocabularyTree tree(descriptor, descriptors.cols, params);
  CheckRows(descriptors, descriptors.cols);
  std::vector<const float*> rows = RowPointers(descriptors), sorted(rows.size());
  std::vector<int> nearest(rows.size());
  struct Part {
    int node;
    std::size_t begin, end;  // Of rows.
  };
  std::deque<Part> parts = {{0, 0, rows.size()}};
  double done = 0.0;
  const double all = static_cast<double>(rows.size()) * params.depth;
  for (; !parts.empty(); parts.pop_front()) {
    const Part part = parts.front();
    const std::size_t count = part.end - part.begin;
    const int depth = tree.nodes_[part.node].depth;
    std::vector<float> centroids;
    if (depth < params.depth && count >= static_cast<std::size_t>(kMinRowsPerChild) * params.branching) {
      centroids = tree.Divide(part.node, rows.data() + part.begin, count);
    }
    const int children = static_cast<int>(centroids.size() / tree.length_);
    done += static_cast<double>(count) * (children < 2 ? params.depth - depth : 1);
    if (progress) progress(std::min(1.0, done / all));
    if (children < 2) continue;
    tree.AddChildren(part.node, centroids.data(), children);
    const Node& parent = tree.nodes_[part.node];
    AssignParallel(tree.Centroids(parent.block), children, tree.length_, rows.data() + part.begin, count, nearest.data());
    std::vector<std::size_t> begin(children + 1, part.begin);
    for (std::size_t i = 0; i < count; ++i) ++begin[nearest[i] + 1];
    for (int c = 0; c < children; ++c) begin[c + 1] += begin[c] - part.begin;
    for (int c = 0; c < children; ++c) parts.push_back({parent.first_child + c, begin[c], begin[c + 1]});
    for (std::size_t i = 0; i < count; ++i) sorted[begin[nearest[i]]++] = rows[part.begin + i];
    std::copy(sorted.begin() + part.begin, sorted.begin() + part.end, rows.begin() + part.begin);
  }
  return tree;
}

std::size_t VocabularyTree::memory_bytes() const {
  return nodes_.size() * sizeof(Node) + leaf_nodes_.size() * sizeof(std::int32_t) +
         chunks_.size() * kChunkBlocks * PackedFloats(kBlock, length_) * sizeof(float);
}

namespace {

// A node that a row has come to. Nearer is less; ties by number, so that the order of work is of no matter.
struct Reached {
  float excess;
  int node;
  bool operator<(const Reached& other) const { return excess != other.excess ? excess < other.excess : node < other.node; }
};

// Keeps the best `most`, best first.
void Offer(std::vector<Reached>& best, std::size_t most, const Reached& candidate) {
  if (best.size() == most) {
    if (!(candidate < best.back())) return;
  } else {
    best.emplace_back();
  }
  std::size_t at = best.size() - 1;
  for (; at > 0 && candidate < best[at - 1]; --at) best[at] = best[at - 1];
  best[at] = candidate;
}

}  // namespace

// Always compares as many rows at once: one alone would be rounded differently, and its leaf depend on who comes with it.
void VocabularyTree::NearestChildren(int node, const cv::Mat& descriptors, const int* rows, std::size_t count, int* nearest) const {
  const int children = nodes_[node].children, padded = PaddedCount(children);
  std::vector<float> excess(static_cast<std::size_t>(kComparedRows) * padded);
  for (std::size_t i = 0; i < count; i += kComparedRows) {
    const float* compared[kComparedRows];
    const std::size_t now = std::min<std::size_t>(kComparedRows, count - i);
    for (std::size_t r = 0; r < kComparedRows; ++r) compared[r] = descriptors.ptr<float>(rows[i + (r < now ? r : 0)]);
    CompareWithCentroids(Centroids(nodes_[node].block), children, length_, compared, kComparedRows, excess.data());
    for (std::size_t r = 0; r < now; ++r) {
      const float* first = excess.data() + r * padded;
      nearest[i + r] = static_cast<int>(std::min_element(first, first + children) - first);
    }
  }
}

// One path: level by level, rows at one node together, so that its centroids are fetched once for all of them.
void VocabularyTree::FollowNearest(const cv::Mat& descriptors, int* leaves) const {
  struct Group {
    int node;
    std::size_t begin, end;  // Of rows.
  };
  const std::size_t count = descriptors.rows;
  std::vector<int> rows(count), sorted(count), nearest(count);
  std::iota(rows.begin(), rows.end(), 0);
  std::vector<std::size_t> begin;
  std::vector<Group> groups = {{0, 0, count}}, next;
  for (; !groups.empty(); groups.swap(next), rows.swap(sorted)) {
    next.clear();
    for (const Group& group : groups) {
      const Node& node = nodes_[group.node];
      if (node.children == 0) {
        for (std::size_t i = group.begin; i < group.end; ++i) leaves[rows[i]] = node.leaf;
        continue;
      }
      NearestChildren(group.node, descriptors, rows.data() + group.begin, group.end - group.begin, nearest.data() + group.begin);
      begin.assign(node.children + 1, group.begin);
      for (std::size_t i = group.begin; i < group.end; ++i) ++begin[nearest[i] + 1];
      for (int c = 0; c < node.children; ++c) {
        begin[c + 1] += begin[c] - group.begin;
        if (begin[c + 1] > begin[c]) next.push_back({node.first_child + c, begin[c], begin[c + 1]});
      }
      for (std::size_t i = group.begin; i < group.end; ++i) sorted[begin[nearest[i]]++] = rows[i];
    }
  }
}

Words VocabularyTree::Quantise(const cv::Mat& descriptors, int paths) const {
  CheckRows(descriptors, length_);
  if (paths < 1) throw std::invalid_argument("vocabulary: paths must be >= 1, is " + std::to_string(paths));
  Words words;
  words.paths = paths;
  words.leaves.assign(static_cast<std::size_t>(descriptors.rows) * paths, -1);
  if (paths == 1) {
    FollowNearest(descriptors, words.leaves.data());
    return words;
  }
  std::vector<float> excess(PaddedCount(params_.branching));
  std::vector<Reached> reached, next;
  for (int r = 0; r < descriptors.rows; ++r) {
    const float* row = descriptors.ptr<float>(r);
    reached.assign(1, {0.f, 0});
    for (bool deeper = nodes_[0].children > 0; deeper;) {
      deeper = false;
      next.clear();
      for (const Reached& from : reached) {
        const Node& node = nodes_[from.node];
        if (node.children == 0) {
          Offer(next, paths, from);
          continue;
        }
        CompareWithCentroids(Centroids(node.block), node.children, length_, &row, 1, excess.data());
        for (int c = 0; c < node.children; ++c) {
          if (static_cast<int>(next.size()) == paths && excess[c] > next.back().excess) continue;
          Offer(next, paths, {excess[c], node.first_child + c});
        }
      }
      for (const Reached& to : next) deeper = deeper || nodes_[to.node].children > 0;
      reached.swap(next);
    }
    for (std::size_t i = 0; i < reached.size(); ++i) {
      words.leaves[static_cast<std::size_t>(r) * paths + i] = nodes_[reached[i].node].leaf;
    }
  }
  return words;
}

int VocabularyTree::Split(int leaf, const cv::Mat& descriptors) {
  CheckRows(descriptors, length_);
  const int node = leaf_nodes_.at(leaf);
  if (nodes_[node].depth >= kMaxDepth) return -1;
  const std::vector<const float*> rows = RowPointers(descriptors);
  const std::vector<float> centroids = Divide(node, rows.data(), rows.size());
  const int children = static_cast<int>(centroids.size() / length_);
  if (children < 2) return -1;
  AddChildren(node, centroids.data(), children);
  return node;
}

std::vector<int> VocabularyTree::LeavesUnder(int node, const cv::Mat& descriptors) const {
  CheckRows(descriptors, length_);
  const Node& parent = nodes_.at(node);
  const std::vector<const float*> rows = RowPointers(descriptors);
  std::vector<int> leaves(rows.size());
  AssignToCentroids(Centroids(parent.block), parent.children, length_, rows.data(), rows.size(), leaves.data());
  for (int& leaf : leaves) leaf = nodes_[parent.first_child + leaf].leaf;
  return leaves;
}

}  // namespace vantage::recognition
