#include "recognition/inverted_file.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>

#include "recognition/codes.h"

namespace vantage::recognition {
namespace {

constexpr double kWeightStep = 0.05;     // ln N_i that is out by less is not worth a walk over the leaf.
constexpr std::size_t kLeavesAhead = 6;  // Whose ends are fetched from memory while a view's points go into earlier ones.
constexpr int kUrgent = 4;  // A leaf that came to hold so many times too many is split before others, or it would take long.

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

int InvertedFile::LargestLeaf() const {
  std::size_t most = 0;
  for (const Leaf& leaf : leaves_) most = std::max(most, leaf.points.size());
  return static_cast<int>(most);
}

}  // namespace vantage::recognition
