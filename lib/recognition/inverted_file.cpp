#include "recognition/inverted_file.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <tuple>

namespace vantage::recognition {
namespace {

constexpr double kWeightStep = 0.02;      // ln N_i that is out by less is not worth a walk over the leaf.
constexpr float kCodeScale = 127 / 0.7f;  // Unit descriptors of 64 or 128 values hardly hold a value beyond 0.7.
constexpr std::size_t kLeavesAhead = 6;   // Whose ends are fetched from memory while a view's points go into earlier ones.
constexpr int kUrgent = 4;  // A leaf that came to hold so many times too many is split before others, or it would take long.
constexpr int kTrainingSample = 128;  // Rows a cluster that k-means looks at (KMeansParams), for the cost of a split.

// 8 bits a value, rounded.
template <typename Code>
void Encode(const float* row, int length, Code* codes) {
  for (int i = 0; i < length; ++i) {
    const float value = std::min(127.f, std::max(-127.f, row[i] * kCodeScale));
    codes[i] = static_cast<Code>(value + (value < 0.f ? -0.5f : 0.5f));
  }
}

__attribute__((target_clones("arch=x86-64-v3", "default"))) void CodeProducts(const std::int16_t* query, const std::int8_t* codes,
                                                                              int count, int length, std::int32_t* products) {
  for (int p = 0; p < count; ++p, codes += length) {
    std::int32_t sum = 0;
    for (int i = 0; i < length; ++i) sum += query[i] * codes[i];
    products[p] = sum;
  }
}

void CheckNumbers(int object, int view) {
  if (object < 0 || view < 0) throw std::invalid_argument("inverted file: object and view must be >= 0");
}

}  // namespace

void InvertedFileParams::Check() const {
  const auto require = [](bool ok, const std::string& what) {
    if (!ok) throw std::invalid_argument("inverted file: " + what);
  };
  require(background_documents > 0.0, "background_documents must be > 0, is " + std::to_string(background_documents));
  require(max_leaf_points >= 0, "max_leaf_points must be >= 0, is " + std::to_string(max_leaf_points));
  require(stop_leaf_points >= 1, "stop_leaf_points must be >= 1, is " + std::to_string(stop_leaf_points));
  require(refine_distances >= 0, "refine_distances must be >= 0, is " + std::to_string(refine_distances));
}

InvertedFile::InvertedFile(VocabularyTree tree, const InvertedFileParams& params) : params_(params), tree_(std::move(tree)) {
  params.Check();
  leaves_.resize(tree_.leaves());
}

std::size_t InvertedFile::memory_bytes() const {
  std::size_t bytes = leaves_.size() * sizeof(Leaf) + slots_.size() * (sizeof(Slot) + sizeof(Owner));
  for (const Leaf& leaf : leaves_) {
    bytes += leaf.points.capacity() * sizeof(Point) + leaf.codes.capacity() + leaf.holders.capacity() * sizeof(Holder);
  }
  for (const Slot& slot : slots_) bytes += slot.leaves.capacity() * sizeof(std::int32_t);
  return bytes;
}

double InvertedFile::LogDocuments() const { return std::log(objects() + params_.background_documents); }

double InvertedFile::NormOf(const Slot& slot, double log_documents) const {
  if (params_.norm == Norm::kL1) return log_documents * slot.m - slot.ml;
  return std::sqrt(std::max(0.0, (log_documents * slot.m2 - 2.0 * slot.m2l) * log_documents + slot.m2l2));
}

// visitor(slot, term frequency) for every view in the leaf.
template <typename Visitor>
void InvertedFile::ForEachRun(const Leaf& leaf, const Visitor& visit) {
  const std::size_t size = leaf.points.size();
  for (std::size_t start = 0, end = 0; start < size; start = end) {
    while (end < size && leaf.points[end].slot == leaf.points[start].slot) ++end;
    visit(leaf.points[start].slot, static_cast<int>(end - start));
  }
}

void InvertedFile::Contribute(const Leaf& leaf, double sign) {
  if (leaf.stopped) return;
  const double l = leaf.log_objects;
  ForEachRun(leaf, [&](int index, int frequency) { slots_[index].Add(sign, frequency, l); });
}

void InvertedFile::Slot::Add(double sign, double frequency, double l) {
  m += sign * frequency;
  ml += sign * frequency * l;
  m2 += sign * frequency * frequency;
  m2l += sign * frequency * frequency * l;
  m2l2 += sign * frequency * frequency * l * l;
}

void InvertedFile::Slot::Reweigh(double frequency, double step, double square_step) {
  ml += frequency * step;
  m2l += frequency * frequency * step;
  m2l2 += frequency * frequency * square_step;
}

void InvertedFile::UpdateWeight(Leaf& leaf) {
  const double log_objects = leaf.holders.empty() ? 0.0 : std::log(leaf.holders.size());
  const bool stopped = static_cast<int>(leaf.points.size()) > params_.stop_leaf_points;
  if (stopped == leaf.stopped && std::abs(log_objects - leaf.log_objects) < kWeightStep) return;
  if (stopped || leaf.stopped) {
    Contribute(leaf, -1.0);
    leaf.log_objects = log_objects;
    leaf.stopped = stopped;
    Contribute(leaf, 1.0);
    return;
  }
  const double step = log_objects - leaf.log_objects;
  const double square_step = log_objects * log_objects - leaf.log_objects * leaf.log_objects;
  ForEachRun(leaf, [&](int index, int frequency) { slots_[index].Reweigh(frequency, step, square_step); });
  leaf.log_objects = log_objects;
}

void InvertedFile::CountHolder(Leaf& leaf, int object, int points) {
  const auto at = std::lower_bound(leaf.holders.begin(), leaf.holders.end(), object,
                                   [](const Holder& holder, int number) { return holder.object < number; });
  if (at == leaf.holders.end() || at->object != object) {
    leaf.holders.insert(at, {object, points});
  } else if ((at->points += points) == 0) {
    leaf.holders.erase(at);
  }
}

void InvertedFile::Insert(int index, int slot, const int* keypoints, int count, const cv::Mat& descriptors) {
  Leaf& leaf = leaves_[index];
  for (int i = 0; i < count; ++i) {
    leaf.points.push_back({slot, keypoints[i]});
    leaf.codes.resize(leaf.codes.size() + descriptors.cols);
    Encode(descriptors.ptr<float>(keypoints[i]), descriptors.cols, leaf.codes.data() + leaf.codes.size() - descriptors.cols);
  }
  if (!leaf.stopped) slots_[slot].Add(1.0, count, leaf.log_objects);
  CountHolder(leaf, owners_[slot].object, count);
  UpdateWeight(leaf);
  if (params_.max_leaf_points == 0) return;
  const int split_at = std::max(leaf.split_at, params_.max_leaf_points), urgent_at = kUrgent * split_at;
  const int size = static_cast<int>(leaf.points.size());
  if (size > urgent_at && size - count <= urgent_at) {
    overfull_.push_front(index);
  } else if (size > split_at && size - count <= split_at) {
    overfull_.push_back(index);
  }
}

// Asks the memory for what Insert will write to.
void InvertedFile::FetchEnds(const Leaf& leaf) {
  __builtin_prefetch(leaf.points.data() + leaf.points.size(), 1);
  __builtin_prefetch(leaf.codes.data() + leaf.codes.size(), 1);
  __builtin_prefetch(leaf.holders.data() + leaf.holders.size() / 2);
}

void InvertedFile::SetView(int object, int view, const cv::Mat& descriptors) {
  CheckNumbers(object, view);
  const Words words = tree_.Quantise(descriptors);
  RemoveView(object, view);
  int index = static_cast<int>(slots_.size());
  if (free_slots_.empty()) {
    slots_.emplace_back();
    owners_.emplace_back();
  } else {
    index = free_slots_.back();
    free_slots_.pop_back();
  }
  Slot& slot = slots_[index];
  owners_[index] = {object, view};
  slot.leaves = words.leaves;
  views_of_[object][view] = index;
  ++view_count_;
  point_count_ += words.leaves.size();
  std::vector<int> order(words.leaves.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return words.leaves[a] < words.leaves[b]; });
  for (std::size_t start = 0, end = 0; start < order.size(); start = end) {
    const int leaf = words.leaves[order[start]];
    if (start + kLeavesAhead < order.size()) FetchEnds(leaves_[words.leaves[order[start + kLeavesAhead]]]);
    while (end < order.size() && words.leaves[order[end]] == leaf) ++end;
    Insert(leaf, index, order.data() + start, static_cast<int>(end - start), descriptors);
  }
  Refine(params_.refine_distances);
}

void InvertedFile::RemoveSlot(int index) {
  Slot& slot = slots_[index];
  std::vector<int> leaves(slot.leaves.begin(), slot.leaves.end());
  std::sort(leaves.begin(), leaves.end());
  leaves.erase(std::unique(leaves.begin(), leaves.end()), leaves.end());
  const int length = tree_.length();
  for (const int number : leaves) {
    Leaf& leaf = leaves_[number];
    const auto first = std::find_if(leaf.points.begin(), leaf.points.end(), [&](const Point& p) { return p.slot == index; });
    const auto last = std::find_if(first, leaf.points.end(), [&](const Point& p) { return p.slot != index; });
    const auto begin = first - leaf.points.begin(), end = last - leaf.points.begin();
    leaf.codes.erase(leaf.codes.begin() + begin * length, leaf.codes.begin() + end * length);
    leaf.points.erase(first, last);
    CountHolder(leaf, owners_[index].object, -static_cast<int>(end - begin));
    UpdateWeight(leaf);
  }
  --view_count_;
  point_count_ -= slot.leaves.size();
  slot = Slot();
  owners_[index] = Owner();
  free_slots_.push_back(index);
}

void InvertedFile::RemoveView(int object, int view) {
  const auto views = views_of_.find(object);
  if (views == views_of_.end()) return;
  const auto found = views->second.find(view);
  if (found == views->second.end()) return;
  RemoveSlot(found->second);
  views->second.erase(found);
  if (views->second.empty()) views_of_.erase(views);
}

void InvertedFile::RemoveObject(int object) {
  const auto views = views_of_.find(object);
  if (views == views_of_.end()) return;
  for (const auto& [view, slot] : views->second) RemoveSlot(slot);
  views_of_.erase(views);
}

int InvertedFile::SplitCost(const Leaf& leaf) const {
  const int branching = tree_.params().branching, points = static_cast<int>(leaf.points.size());
  return std::min(points, branching * kTrainingSample) * branching * (tree_.params().iterations + 1) + points * branching;
}

bool InvertedFile::Refine(int distances) {
  for (bool first = true; !overfull_.empty(); first = false) {
    const int leaf = overfull_.front();
    if (static_cast<int>(leaves_[leaf].points.size()) > params_.max_leaf_points) {
      distances -= SplitCost(leaves_[leaf]);
      if (distances < 0 && !first) return true;
      SplitLeaf(leaf);
    }
    overfull_.pop_front();
  }
  return false;
}

// Descriptors of the leaf's points first, first + step, ...; at most `count`.
cv::Mat InvertedFile::Decode(const Leaf& leaf, int first, int step, int count) const {
  const int length = tree_.length(), points = static_cast<int>(leaf.points.size());
  cv::Mat rows(std::max(0, std::min(count, (points - first + step - 1) / step)), length, CV_32F);
  for (int r = 0; r < rows.rows; ++r) {
    const std::int8_t* code = leaf.codes.data() + (static_cast<std::size_t>(first) + static_cast<std::size_t>(r) * step) * length;
    float* row = rows.ptr<float>(r);
    for (int i = 0; i < length; ++i) row[i] = code[i] / kCodeScale;
  }
  return rows;
}

void InvertedFile::SplitLeaf(int number) {
  const int length = tree_.length(), points = static_cast<int>(leaves_[number].points.size());
  const int looked_at = tree_.params().branching * kTrainingSample;
  const int node = tree_.Split(number, Decode(leaves_[number], 0, (points + looked_at - 1) / looked_at, looked_at));
  if (node < 0) {
    leaves_[number].split_at = 2 * points;  // They are alike: not again before there are many others.
    return;
  }
  std::vector<int> parts;
  for (int first = 0; first < points; first += looked_at) {
    const std::vector<int> some = tree_.LeavesUnder(node, Decode(leaves_[number], first, 1, looked_at));
    parts.insert(parts.end(), some.begin(), some.end());
  }
  Contribute(leaves_[number], -1.0);
  const Leaf old = std::move(leaves_[number]);
  leaves_[number] = Leaf();
  leaves_.resize(tree_.leaves());
  for (int p = 0; p < points; ++p) {
    Leaf& leaf = leaves_[parts[p]];
    const Point& point = old.points[p];
    leaf.points.push_back(point);
    leaf.codes.insert(leaf.codes.end(), old.codes.begin() + p * length, old.codes.begin() + (p + 1) * length);
    CountHolder(leaf, owners_[point.slot].object, 1);
    slots_[point.slot].leaves[point.keypoint] = parts[p];
  }
  std::vector<int> made(parts);
  std::sort(made.begin(), made.end());
  made.erase(std::unique(made.begin(), made.end()), made.end());
  for (const int part : made) {
    Leaf& leaf = leaves_[part];
    leaf.log_objects = std::log(leaf.holders.size());
    leaf.stopped = static_cast<int>(leaf.points.size()) > params_.stop_leaf_points;
    Contribute(leaf, 1.0);
    if (static_cast<int>(leaf.points.size()) > params_.max_leaf_points) overfull_.push_back(part);
  }
}

int InvertedFile::LargestLeaf() const {
  std::size_t most = 0;
  for (const Leaf& leaf : leaves_) most = std::max(most, leaf.points.size());
  return static_cast<int>(most);
}

std::vector<Ranked> InvertedFile::Rank(const Words& words, int count, int paths) const {
  if (words.rows() == 0 || views_of_.empty()) return {};
  std::vector<int> leaves;
  for (int row = 0; row < words.rows(); ++row) {
    for (int i = 0; i < std::min(paths, words.paths) && words.of(row)[i] >= 0; ++i) leaves.push_back(words.of(row)[i]);
  }
  std::sort(leaves.begin(), leaves.end());
  const double log_documents = LogDocuments();
  struct Term {
    const Leaf* leaf;
    double weight;
    double value;  // q_i of (3).
  };
  std::vector<Term> terms;
  double query_norm = 0.0;
  for (std::size_t start = 0, end = 0; start < leaves.size(); start = end) {
    while (end < leaves.size() && leaves[end] == leaves[start]) ++end;
    const Leaf& leaf = leaves_[leaves[start]];
    const double weight = leaf.stopped ? 0.0 : std::max(0.0, log_documents - leaf.log_objects);
    const double value = static_cast<double>(end - start) * weight;
    query_norm += params_.norm == Norm::kL1 ? value : value * value;
    if (weight > 0.0 && !leaf.points.empty()) terms.push_back({&leaf, weight, value});
  }
  if (params_.norm == Norm::kL2) query_norm = std::sqrt(query_norm);

  // |q/|q| - d/|d|| needs only what both have: 2 - 2 sum min(q_i, d_i) in L1, 2 - 2 sum q_i d_i squared in L2.
  std::vector<double> norms(slots_.size(), 0.0), common(slots_.size(), 0.0);
  std::vector<int> touched;
  for (const Term& term : terms) {
    const double q = term.value / query_norm;
    ForEachRun(*term.leaf, [&](int slot, int frequency) {
      double& norm = norms[slot];
      if (norm == 0.0) {
        norm = std::max(1e-12, NormOf(slots_[slot], log_documents));
        touched.push_back(slot);
      }
      const double d = frequency * term.weight / norm;
      common[slot] += params_.norm == Norm::kL1 ? std::min(q, d) : q * d;
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
  struct Candidate {
    std::int32_t product;
    Point point;
  };
  const auto is_allowed = [&](const Point& point) {
    const int object = owners_[point.slot].object;
    return object < static_cast<int>(allowed.size()) && allowed[object];
  };
  const int length = tree_.length();
  std::vector<std::int16_t> code(length);
  std::vector<std::int32_t> products;
  std::vector<Candidate> best;
  for (int row = 0; row < query.rows; ++row) {
    Encode(query.ptr<float>(row), length, code.data());
    best.clear();
    std::int32_t least = std::numeric_limits<std::int32_t>::min();  // Only what is nearer goes in.
    for (int w = 0; w < words.paths && words.of(row)[w] >= 0; ++w) __builtin_prefetch(&leaves_[words.of(row)[w]]);
    for (int w = 0; w < words.paths && words.of(row)[w] >= 0; ++w) {
      const Leaf& leaf = leaves_[words.of(row)[w]];
      if (w + 1 < words.paths && words.of(row)[w + 1] >= 0) __builtin_prefetch(leaves_[words.of(row)[w + 1]].codes.data());
      const int points = static_cast<int>(leaf.points.size());
      products.resize(std::max<std::size_t>(products.size(), points));
      CodeProducts(code.data(), leaf.codes.data(), points, length, products.data());
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
      const float cosine = candidate.product / (kCodeScale * kCodeScale);
      nearest[row].push_back({owner.object, owner.view, candidate.point.keypoint, std::sqrt(std::max(0.f, 2.f - 2.f * cosine))});
    }
  }
  return nearest;
}

}  // namespace vantage::recognition
