// What an inverted file is asked: objects by score (5), and the stored points nearest to those of a frame.
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <tuple>

#include "recognition/codes.h"
#include "recognition/inverted_file.h"

namespace vantage::recognition {

double InvertedFile::LogDocuments() const { return std::log(objects() + params_.background_documents); }

double InvertedFile::NormOf(const Slot& slot, double log_documents) const {
  if (params_.norm == Norm::kL1) return log_documents * slot.m - slot.ml;
  return std::sqrt(std::max(0.0, (log_documents * slot.m2 - 2.0 * slot.m2l) * log_documents + slot.m2l2));
}

// The query's leaves that count, with its q_i of (3), which sum (L1) or square-sum (L2) to 1.
std::vector<InvertedFile::Term> InvertedFile::TermsOf(const Words& words, int paths) const {
  std::vector<int> leaves;
  for (int row = 0; row < words.rows(); ++row) {
    for (int i = 0; i < std::min(paths, words.paths) && words.of(row)[i] >= 0; ++i) leaves.push_back(words.of(row)[i]);
  }
  std::sort(leaves.begin(), leaves.end());
  const double log_documents = LogDocuments();
  std::vector<Term> terms;
  double norm = 0.0;
  for (std::size_t start = 0, end = 0; start < leaves.size(); start = end) {
    while (end < leaves.size() && leaves[end] == leaves[start]) ++end;
    const Leaf& leaf = leaves_[leaves[start]];
    const double weight = leaf.stopped ? 0.0 : std::max(0.0, log_documents - leaf.log_objects);
    const double value = static_cast<double>(end - start) * weight;
    norm += params_.norm == Norm::kL1 ? value : value * value;
    if (weight > 0.0 && !leaf.points.empty()) terms.push_back({&leaf, weight, value});
  }
  if (params_.norm == Norm::kL2) norm = std::sqrt(norm);
  for (Term& term : terms) term.value /= norm;
  return terms;
}

std::vector<Ranked> InvertedFile::Rank(const Words& words, int count, int paths) const {
  if (words.rows() == 0 || views_of_.empty()) return {};
  // |q/|q| - d/|d|| needs only what both have: 2 - 2 sum min(q_i, d_i) in L1, 2 - 2 sum q_i d_i squared in L2.
  const double log_documents = LogDocuments();
  std::vector<double> norms(slots_.size(), 0.0), common(slots_.size(), 0.0);
  std::vector<int> touched;
  for (const Term& term : TermsOf(words, paths)) {
    ForEachRun(*term.leaf, [&](int slot, int frequency) {
      double& norm = norms[slot];
      if (norm == 0.0) {
        norm = std::max(1e-12, NormOf(slots_[slot], log_documents));
        touched.push_back(slot);
      }
      const double d = frequency * term.weight / norm;
      common[slot] += params_.norm == Norm::kL1 ? std::min(term.value, d) : term.value * d;
    });
  }
  std::vector<int> best(views_of_.rbegin()->first + 1, -1);  // The most similar view's slot by object.
  for (const int slot : touched) {
    int& most = best[owners_[slot].object];
    if (most < 0 || std::make_pair(common[most], owners_[slot].view) < std::make_pair(common[slot], owners_[most].view))
      most = slot;
  }
  std::vector<Ranked> ranking;
  for (const int slot : best) {
    if (slot < 0) continue;
    const double left = std::max(0.0, 2.0 - 2.0 * common[slot]);
    ranking.push_back({owners_[slot].object, owners_[slot].view, params_.norm == Norm::kL1 ? left : std::sqrt(left)});
  }
  const auto first = ranking.begin() + std::min<std::ptrdiff_t>(std::max(0, count), ranking.end() - ranking.begin());
  std::partial_sort(ranking.begin(), first, ranking.end(),
                    [](const Ranked& a, const Ranked& b) { return std::tie(a.score, a.object) < std::tie(b.score, b.object); });
  ranking.erase(first, ranking.end());
  return ranking;
}

std::vector<std::vector<Neighbour>> InvertedFile::Nearest(const cv::Mat& query, const Words& words, int count,
                                                          const std::vector<char>& allowed) const {
  if (words.rows() != query.rows) throw std::invalid_argument("inverted file: words of other rows");
  std::vector<std::vector<Neighbour>> nearest(query.rows);
  if (count < 1) return nearest;
  const auto is_allowed = [&](const Point& point) {
    const int object = owners_[point.slot].object;
    return object < static_cast<int>(allowed.size()) && allowed[object];
  };
  std::vector<std::int16_t> code(tree_.length());
  std::vector<std::int32_t> products;
  struct Candidate {
    std::int32_t product;
    Point point;
  };
  std::vector<Candidate> best;
  for (int row = 0; row < query.rows; ++row) {
    Encode(query.ptr<float>(row), tree_.length(), code.data());
    best.clear();
    std::int32_t least = std::numeric_limits<std::int32_t>::min();  // Only what is nearer goes in.
    const int* leaves = words.of(row);
    const int leaf_count = static_cast<int>(std::find(leaves, leaves + words.paths, -1) - leaves);
    for (int w = 0; w < leaf_count; ++w) __builtin_prefetch(&leaves_[leaves[w]]);
    for (int w = 0; w < leaf_count; ++w) {
      if (w + 1 < leaf_count) __builtin_prefetch(leaves_[leaves[w + 1]].codes.data());
      const Leaf& leaf = leaves_[leaves[w]];
      const int points = static_cast<int>(leaf.points.size());
      products.resize(std::max<std::size_t>(products.size(), points));
      CodeProducts(code.data(), leaf.codes.data(), points, tree_.length(), products.data());
      for (int p = 0; p < points; ++p) {
        if (products[p] <= least) continue;
        if (!allowed.empty() && !is_allowed(leaf.points[p])) continue;
        if (static_cast<int>(best.size()) < count) best.emplace_back();
        std::size_t at = best.size() - 1;
        for (; at > 0 && products[p] > best[at - 1].product; --at) best[at] = best[at - 1];
        best[at] = {products[p], leaf.points[p]};
        if (static_cast<int>(best.size()) == count) least = best.back().product;
      }
    }
    nearest[row].reserve(best.size());
    for (const Candidate& candidate : best) {
      const Owner& owner = owners_[candidate.point.slot];
      nearest[row].push_back({owner.object, owner.view, candidate.point.keypoint, CodeDistance(candidate.product)});
    }
  }
  return nearest;
}

}  // namespace vantage::recognition
