#include "segmentation/components.h"

#include <algorithm>
#include <numeric>
#include <vector>

namespace vantage::segmentation {
namespace {

// Disjoint sets over pixel indices (union by index, path halving).
class DisjointSets {
 public:
  explicit DisjointSets(int size) : parents_(size) { std::iota(parents_.begin(), parents_.end(), 0); }
  int Find(int a) {
    while (parents_[a] != a) a = parents_[a] = parents_[parents_[a]];
    return a;
  }
  void Unite(int a, int b) {
    a = Find(a), b = Find(b);
    if (a != b) parents_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<int> parents_;
};

DisjointSets Connect(const cv::Mat& states, const cv::Mat& cloud, const ClusterParams& params) {
  DisjointSets sets(states.rows * states.cols);
  const auto join = [&](const cv::Point& from, float z, const cv::Point& direction) {
    const int steps = StepsToNext(states, from, direction, params.bridge_px);
    const cv::Point to = from + steps * direction;
    if (steps == 0 || states.at<std::uint8_t>(to) != kAbove || !OnOneSurface(z, cloud.at<cv::Vec3f>(to)[2], steps, params))
      return false;
    sets.Unite(from.y * states.cols + from.x, to.y * states.cols + to.x);
    return steps == 1;
  };
  for (int y = 0; y < states.rows; ++y) {
    for (int x = 0; x < states.cols; ++x) {
      if (states.at<std::uint8_t>(y, x) != kAbove) continue;
      const float z = cloud.at<cv::Vec3f>(y, x)[2];
      const bool right = join({x, y}, z, {1, 0}), below = join({x, y}, z, {0, 1});
      if (right && below) continue;  // On a closed surface these do.
      join({x, y}, z, {1, 1});
      join({x, y}, z, {-1, 1});
    }
  }
  return sets;
}

}  // namespace

cv::Mat Classify(const cv::Mat& cloud, const Plane& plane, const ClusterParams& params) {
  cv::Mat states(cloud.size(), CV_8UC1, cv::Scalar(kUnknown));
  const cv::Vec3f normal(static_cast<float>(plane.normal.x()), static_cast<float>(plane.normal.y()),
                         static_cast<float>(plane.normal.z()));
  const float offset = static_cast<float>(plane.offset_m);
  for (int y = 0; y < cloud.rows; ++y) {
    const cv::Vec3f* points = cloud.ptr<cv::Vec3f>(y);
    std::uint8_t* row = states.ptr<std::uint8_t>(y);
    for (int x = 0; x < cloud.cols; ++x) {
      if (std::isnan(points[x][2])) continue;
      const float height = normal.dot(points[x]) + offset;
      row[x] = height >= params.min_height_m && height <= params.max_height_m ? kAbove : kOther;
    }
  }
  return states;
}

int Components(const cv::Mat& states, const cv::Mat& cloud, const ClusterParams& params, cv::Mat* labels) {
  DisjointSets sets = Connect(states, cloud, params);
  labels->create(states.size(), CV_32SC1);
  labels->setTo(0);
  int* label = labels->ptr<int>();
  int count = 0;
  // A set's root is its first pixel, so it was labelled before all its others.
  for (int i = 0; i < states.rows * states.cols; ++i) {
    if (states.data[i] != kAbove) continue;
    const int root = sets.Find(i);
    label[i] = root == i ? ++count : label[root];
  }
  return count;
}

}  // namespace vantage::segmentation
