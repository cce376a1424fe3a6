// Inverted files over the leaves of a vocabulary tree: ranks objects by score (5) and finds tentative matches (section IV-A).
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <opencv2/core.hpp>
#include <vector>

#include "recognition/vocabulary_tree.h"

namespace vantage::recognition {

enum class Norm { kL1, kL2 };

struct InvertedFileParams {
  Norm norm = Norm::kL1;              // Of score (5).
  double background_documents = 1.0;  // B: w_i = ln((N + B) / N_i); > 0.
  int max_leaf_points = 200;          // A leaf that holds more is split; 0 = the tree stays as it is. >= 0.
  int stop_leaf_points = 20000;       // A leaf that holds more says nothing: its weight is 0; >= 1.
  int refine_distances = 400000;      // Descriptor distances spent on splits per view added, about 2 ms; >= 0.

  void Check() const;  // Throws std::invalid_argument naming the field.
};

// What an object is worth to a query.
struct Ranked {
  int object = 0;
  int view = 0;        // Its most similar one.
  double score = 2.0;  // (5): 0 = the same, 2 (L1) or sqrt(2) (L2) = nothing in common.
};

// A stored interest point near a query descriptor.
struct Neighbour {
  int object = 0;
  int view = 0;
  int keypoint = 0;
  float distance = 2.f;  // Euclidean, +-0.02: descriptors are kept in 8 bits a value.
};

// Objects and views are numbers >= 0 that the caller gives; objects best without large gaps. Descriptors are rows of unit length.
// A view that is added or removed changes the leaves it has points in and nothing else. The same calls in the same order give the
// same file.
class InvertedFile {
 public:
  InvertedFile(VocabularyTree tree, const InvertedFileParams& params);

  const VocabularyTree& tree() const { return tree_; }
  int objects() const { return static_cast<int>(views_of_.size()); }
  int views() const { return view_count_; }
  std::size_t points() const { return point_count_; }
  std::size_t memory_bytes() const;  // Beside the tree's.
  int LargestLeaf() const;           // Points in it. Cost: linear in the leaves.

  // Adds the view or replaces what was there, then refines the tree. Keypoint k is row k. Throws std::invalid_argument where the
  // rows are not ours or a number is negative. Cost: branching x depth distances a row, and the refinement's: params'
  // refine_distances, or one split, which looks at branching x 128 points and moves those that the leaf got since it was overfull.
  void SetView(int object, int view, const cv::Mat& descriptors);
  void RemoveView(int object, int view);  // Nothing where there is none.
  void RemoveObject(int object);

  // Splits overfull leaves, each once `distances` allow (at least one). Returns whether more wait. SetView calls it.
  bool Refine(int distances);

  // Objects with a leaf in common with the query, best first (ties: lower number), at most `count`; an object is as good as its
  // best view. The first `paths` words of a row count. Cost: the points of the visited leaves.
  std::vector<Ranked> Rank(const Words& words, int count, int paths = 1) const;

  // For every query row the stored points nearest to it among those in its leaves, nearest first, at most `count` each; only
  // objects with allowed[object] where `allowed` is not empty.
  std::vector<std::vector<Neighbour>> Nearest(const cv::Mat& query, const Words& words, int count,
                                              const std::vector<char>& allowed = {}) const;

 private:
  struct Point {
    std::int32_t slot;  // Of its view.
    std::int32_t keypoint;
  };
  struct Holder {
    std::int32_t object;
    std::int32_t points;
  };
  struct Leaf {
    std::vector<Point> points;       // Those of one view are neighbours: a run is a term frequency.
    std::vector<std::int8_t> codes;  // Their descriptors.
    std::vector<Holder> holders;     // Ascending objects; N_i is how many.
    double log_objects = 0.0;        // ln N_i as the views' sums know it.
    bool stopped = false;
    int split_at = 0;  // More points than this ask for a split.
  };
  // Whose a slot is.
  struct Owner {
    std::int32_t object = -1;
    std::int32_t view = -1;
  };
  // A leaf of a query.
  struct Term {
    const Leaf* leaf;
    double weight;
    double value;
  };
  // Sums over a view's leaves with term frequency m and l = ln N_i, from which its norm follows for any N: w = ln(N + B) - l.
  struct Slot {
    std::vector<std::int32_t> leaves;  // Of every keypoint.
    double m = 0.0, ml = 0.0, m2 = 0.0, m2l = 0.0, m2l2 = 0.0;

    void Add(double sign, double frequency, double l);
    void Reweigh(double frequency, double step, double square_step);  // Of l and l^2.
  };

  double LogDocuments() const;
  double NormOf(const Slot& slot, double log_documents) const;
  std::vector<Term> TermsOf(const Words& words, int paths) const;
  // visit(slot, term frequency) for every view in the leaf.
  template <typename Visitor>
  static void ForEachRun(const Leaf& leaf, const Visitor& visit) {
    const std::size_t size = leaf.points.size();
    for (std::size_t start = 0, end = 0; start < size; start = end) {
      while (end < size && leaf.points[end].slot == leaf.points[start].slot) ++end;
      visit(leaf.points[start].slot, static_cast<int>(end - start));
    }
  }
  void Contribute(const Leaf& leaf, double sign);
  void Insert(int leaf, int slot, const int* keypoints, int count, const cv::Mat& descriptors);
  static void FetchEnds(const Leaf& leaf);
  void UpdateWeight(Leaf& leaf);
  void SplitLeaf(int leaf);
  cv::Mat DescriptorsOf(const Leaf& leaf, int first, int step, int count) const;
  int SplitCost(const Leaf& leaf) const;
  void CountHolder(Leaf& leaf, int object, int points);
  void RemoveSlot(int slot);

  InvertedFileParams params_;
  VocabularyTree tree_;
  std::deque<Leaf> leaves_;
  std::deque<Slot> slots_;
  std::vector<Owner> owners_;  // By slot; apart, since every tentative match asks.
  std::vector<int> free_slots_;
  std::map<int, std::map<int, int>> views_of_;  // Object -> view -> slot.
  std::deque<int> overfull_;
  int view_count_ = 0;
  std::size_t point_count_ = 0;
};

}  // namespace vantage::recognition
