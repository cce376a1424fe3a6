// How the tree under an inverted file grows: leaves that hold too many points are split.
#include <algorithm>
#include <cmath>

#include "recognition/codes.h"
#include "recognition/inverted_file.h"

namespace vantage::recognition {
namespace {

constexpr int kTrainingSample = 128;  // Rows a cluster that k-means looks at (KMeansParams), for the cost of a split.

}  // namespace

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
cv::Mat InvertedFile::DescriptorsOf(const Leaf& leaf, int first, int step, int count) const {
  const int length = tree_.length(), points = static_cast<int>(leaf.points.size());
  cv::Mat rows(std::max(0, std::min(count, (points - first + step - 1) / step)), length, CV_32F);
  for (int r = 0; r < rows.rows; ++r) {
    Decode(leaf.codes.data() + (static_cast<std::size_t>(first) + static_cast<std::size_t>(r) * step) * length, length,
           rows.ptr<float>(r));
  }
  return rows;
}

void InvertedFile::SplitLeaf(int number) {
  const int length = tree_.length(), points = static_cast<int>(leaves_[number].points.size());
  const int looked_at = tree_.params().branching * kTrainingSample;
  const int node = tree_.Split(number, DescriptorsOf(leaves_[number], 0, (points + looked_at - 1) / looked_at, looked_at));
  if (node < 0) {
    leaves_[number].split_at = 2 * points;  // They are alike: not again before there are many others.
    return;
  }
  std::vector<int> parts;
  for (int first = 0; first < points; first += looked_at) {
    const std::vector<int> some = tree_.LeavesUnder(node, DescriptorsOf(leaves_[number], first, 1, looked_at));
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

}  // namespace vantage::recognition
