#include "segmentation/clusters.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>
#include <utility>

namespace vantage::segmentation {
namespace {

constexpr double kClickRadius_px = 20.0;
constexpr int kPiecesPerObject = 8;     // A piece this much smaller than an object may still be joined to one.
constexpr double kJumpFloor_m2 = 0.25;  // Nearer than half a metre depth noise no longer falls with its square.

void Require(bool ok, const char* what, double found) {
  if (!ok) throw std::invalid_argument(std::string("clusters: ") + what + ", is " + std::to_string(found));
}

enum PixelState : std::uint8_t { kUnknown = 0, kOther = 1, kAbove = 2 };  // No depth; table and far things; object.

// Pixel states by height above the plane.
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

// Joins every object pixel with the next one to the right, below and along both diagonals: across holes up to bridge_px wide, not
// across a depth jump (a slanted surface may fall half as much again for every pixel of a hole), and not across anything measured
// that is no object.
DisjointSets Connect(const cv::Mat& states, const cv::Mat& cloud, const ClusterParams& params) {
  DisjointSets sets(states.rows * states.cols);
  const cv::Point directions[] = {{1, 0}, {0, 1}, {1, 1}, {-1, 1}};
  for (int y = 0; y < states.rows; ++y) {
    for (int x = 0; x < states.cols; ++x) {
      if (states.at<std::uint8_t>(y, x) != kAbove) continue;
      const float z = cloud.at<cv::Vec3f>(y, x)[2];
      const float jump_m = static_cast<float>(params.max_jump_m * std::max(kJumpFloor_m2, static_cast<double>(z) * z));
      for (const cv::Point& direction : directions) {
        for (int step = 1; step <= params.bridge_px + 1; ++step) {
          const int u = x + step * direction.x, v = y + step * direction.y;
          if (u < 0 || u >= states.cols || v >= states.rows) break;
          const std::uint8_t state = states.at<std::uint8_t>(v, u);
          if (state == kUnknown) continue;
          if (state == kAbove &&
              std::abs(cloud.at<cv::Vec3f>(v, u)[2] - z) <= jump_m * (1.0f + 0.5f * static_cast<float>(step - 1)))
            sets.Unite(y * states.cols + x, v * states.cols + u);
          break;
        }
      }
    }
  }
  return sets;
}

// A connected part: several may make up one object.
struct Part {
  std::vector<cv::Point> pixels;
  std::vector<Eigen::Vector3d> points;    // In the order of pixels; camera coordinates, metres.
  std::vector<cv::Point2f> footprint_cm;  // The points seen from above, in the plane.
  std::vector<cv::Point2f> hull_cm;       // Convex hull of the footprint.
  double low_m = 0.0, high_m = 0.0;       // Range of heights above the plane.
};

Eigen::Vector3d Centroid(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) sum += point;
  return sum / static_cast<double>(points.size());
}

// The longest side of the points' box along their principal axes, metres.
double LongestSide(const std::vector<Eigen::Vector3d>& points) {
  const Eigen::Vector3d centroid = Centroid(points);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& point : points) covariance += (point - centroid) * (point - centroid).transpose();
  const Eigen::Matrix3d axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance).eigenvectors();
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e9), high = -low;
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3d along = axes.transpose() * (point - centroid);
    low = low.cwiseMin(along), high = high.cwiseMax(along);
  }
  return (high - low).maxCoeff();
}

Part MakePart(std::vector<cv::Point> pixels, const cv::Mat& cloud, const Plane& plane) {
  Part part;
  part.pixels = std::move(pixels);
  const Eigen::Vector3d u = plane.normal.unitOrthogonal(), v = plane.normal.cross(u);
  part.low_m = 1e9, part.high_m = -1e9;
  for (const cv::Point& pixel : part.pixels) {
    const cv::Vec3f& p = cloud.at<cv::Vec3f>(pixel);
    const Eigen::Vector3d point(p[0], p[1], p[2]);
    part.points.push_back(point);
    part.footprint_cm.emplace_back(static_cast<float>(100.0 * u.dot(point)), static_cast<float>(100.0 * v.dot(point)));
    part.low_m = std::min(part.low_m, plane.Height(point));
    part.high_m = std::max(part.high_m, plane.Height(point));
  }
  cv::convexHull(part.footprint_cm, part.hull_cm);
  return part;
}

// Whether enough of `inner` lies within `outer`, seen from above and seen from the side. What stands on top of something does not.
bool BelongsTo(const Part& inner, const Part& outer, double share) {
  const double common_m = std::min(inner.high_m, outer.high_m) - std::max(inner.low_m, outer.low_m);
  if (common_m < share * (inner.high_m - inner.low_m)) return false;
  if (outer.hull_cm.size() < 3) return false;
  const std::size_t stride = 1 + inner.footprint_cm.size() / 500;  // A few hundred points tell the share.
  int inside = 0, tested = 0;
  for (std::size_t i = 0; i < inner.footprint_cm.size(); i += stride, ++tested)
    inside += cv::pointPolygonTest(outer.hull_cm, inner.footprint_cm[i], false) >= 0.0;
  return inside >= share * tested;
}

Part Join(const Part& a, const Part& b) {
  Part both = a;
  both.pixels.insert(both.pixels.end(), b.pixels.begin(), b.pixels.end());
  both.points.insert(both.points.end(), b.points.begin(), b.points.end());
  both.footprint_cm.insert(both.footprint_cm.end(), b.footprint_cm.begin(), b.footprint_cm.end());
  std::vector<cv::Point2f> corners = a.hull_cm;
  corners.insert(corners.end(), b.hull_cm.begin(), b.hull_cm.end());
  cv::convexHull(corners, both.hull_cm);
  both.low_m = std::min(a.low_m, b.low_m);
  both.high_m = std::max(a.high_m, b.high_m);
  return both;
}

// Joins parts that belong together, largest first, until nothing changes. Never beyond the largest size of an object.
void MergeParts(std::vector<Part>& parts, const ClusterParams& params) {
  std::stable_sort(parts.begin(), parts.end(), [](const Part& a, const Part& b) { return a.pixels.size() > b.pixels.size(); });
  for (std::size_t i = 0; i < parts.size(); ++i) {
    for (std::size_t k = i + 1; k < parts.size(); ++k) {
      if (!BelongsTo(parts[k], parts[i], params.merge_share) && !BelongsTo(parts[i], parts[k], params.merge_share)) continue;
      Part both = Join(parts[i], parts[k]);
      if (LongestSide(both.points) > params.max_size_m) continue;
      parts[i] = std::move(both);
      parts.erase(parts.begin() + static_cast<std::ptrdiff_t>(k));
      k = i;  // The larger hull may hold a part that was passed over.
    }
  }
}

// The connected parts that may be (pieces of) objects.
std::vector<Part> FindParts(const cv::Mat& states, const cv::Mat& cloud, const Plane& plane, const ClusterParams& params) {
  DisjointSets sets = Connect(states, cloud, params);
  std::map<int, std::vector<cv::Point>> members;  // By the set's first pixel, so the order is the same on every run.
  for (int y = 0; y < states.rows; ++y)
    for (int x = 0; x < states.cols; ++x)
      if (states.at<std::uint8_t>(y, x) == kAbove) members[sets.Find(y * states.cols + x)].emplace_back(x, y);
  std::vector<Part> parts;
  for (auto& [root, pixels] : members) {
    if (static_cast<int>(pixels.size()) * kPiecesPerObject < params.min_pixels) continue;
    Part part = MakePart(std::move(pixels), cloud, plane);
    if (LongestSide(part.points) <= params.max_size_m) parts.push_back(std::move(part));
  }
  return parts;
}

// Closes the mask: gaps up to the bridge's width, and holes inside it where nothing was measured. `blocked` pixels (the table,
// other clusters) stay out: a hole through which the table is seen is a hole.
void CloseHoles(cv::Mat& mask, const cv::Mat& blocked, int bridge_px) {
  const int side = 2 * bridge_px + 1;
  const cv::Mat kernel = cv::getStructuringElement(cv::MORPH_ELLIPSE, cv::Size(side, side));
  cv::Mat closed;
  cv::morphologyEx(mask, closed, cv::MORPH_CLOSE, kernel, cv::Point(-1, -1), 1, cv::BORDER_CONSTANT, cv::Scalar(0));
  std::vector<std::vector<cv::Point>> outlines;
  cv::findContours(closed, outlines, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  cv::drawContours(closed, outlines, -1, cv::Scalar(255), cv::FILLED);
  closed.setTo(0, blocked);
  mask |= closed;
}

cv::Mat BlockedFor(const cv::Mat& labels, const cv::Mat& states, int label) {
  return (states == kOther) | ((labels != label) & (labels != 0));
}

bool TouchesBorder(const cv::Rect& box, const cv::Rect& measured, const cv::Size& image) {
  // The strip without depth that sensors leave at the image's border counts as border where it is narrow.
  const int strip_x = image.width / 12, strip_y = image.height / 12;
  const int left = measured.x <= strip_x ? measured.x : 0;
  const int top = measured.y <= strip_y ? measured.y : 0;
  const int right = image.width - measured.br().x <= strip_x ? measured.br().x : image.width;
  const int bottom = image.height - measured.br().y <= strip_y ? measured.br().y : image.height;
  return box.x <= left + 1 || box.y <= top + 1 || box.br().x >= right - 1 || box.br().y >= bottom - 1;
}

double DistanceToMask(const Cluster& cluster, const Eigen::Vector2d& pixel) {
  double nearest = 1e18;
  for (int y = cluster.box.y; y < cluster.box.br().y; ++y)
    for (int x = cluster.box.x; x < cluster.box.br().x; ++x)
      if (cluster.mask.at<std::uint8_t>(y, x)) nearest = std::min(nearest, (Eigen::Vector2d(x, y) - pixel).squaredNorm());
  return std::sqrt(nearest);
}

int Nearest(const std::vector<Cluster>& clusters, const Eigen::Vector2d& pixel, double limit_px) {
  int best = -1;
  double best_px = limit_px;
  for (std::size_t i = 0; i < clusters.size(); ++i) {
    const double distance_px = DistanceToMask(clusters[i], pixel);
    if (distance_px > best_px || (distance_px == best_px && best >= 0)) continue;
    best = static_cast<int>(i);
    best_px = distance_px;
  }
  return best;
}

}  // namespace

void ClusterParams::Check() const {
  Require(std::isfinite(min_height_m) && min_height_m > 0.0, "min_height_m must be > 0", min_height_m);
  Require(max_height_m > min_height_m, "max_height_m must be > min_height_m", max_height_m);
  Require(std::isfinite(max_jump_m) && max_jump_m > 0.0, "max_jump_m must be > 0", max_jump_m);
  Require(bridge_px >= 1, "bridge_px must be >= 1", bridge_px);
  Require(merge_share > 0.0, "merge_share must be > 0", merge_share);
  Require(std::isfinite(min_size_m) && min_size_m > 0.0, "min_size_m must be > 0", min_size_m);
  Require(max_size_m > min_size_m, "max_size_m must be > min_size_m", max_size_m);
  Require(min_pixels >= 1, "min_pixels must be >= 1", min_pixels);
}

std::vector<Cluster> FindClusters(const rgbd::Frame& frame, const Plane& plane, const ClusterParams& params) {
  params.Check();
  if (frame.depth.empty()) return {};
  const cv::Mat cloud = rgbd::OrganisedCloud(frame);
  const cv::Mat states = Classify(cloud, plane, params);
  std::vector<Part> parts = FindParts(states, cloud, plane, params);
  MergeParts(parts, params);

  cv::Mat labels(states.size(), CV_32SC1, cv::Scalar(0));
  std::vector<Cluster> clusters;
  for (const Part& part : parts) {
    if (static_cast<int>(part.pixels.size()) < params.min_pixels || LongestSide(part.points) < params.min_size_m) continue;
    Cluster cluster;
    cluster.pixels = static_cast<int>(part.pixels.size());
    cluster.centroid = Centroid(part.points);
    cluster.mask = cv::Mat::zeros(states.size(), CV_8UC1);
    clusters.push_back(cluster);
    for (const cv::Point& pixel : part.pixels) {
      cluster.mask.at<std::uint8_t>(pixel) = 255;
      labels.at<int>(pixel) = static_cast<int>(clusters.size());
    }
  }

  const cv::Rect measured = cv::boundingRect(states != kUnknown);
  for (std::size_t i = 0; i < clusters.size(); ++i) {
    CloseHoles(clusters[i].mask, BlockedFor(labels, states, static_cast<int>(i) + 1), params.bridge_px);
    clusters[i].box = cv::boundingRect(clusters[i].mask);
    clusters[i].touches_border = TouchesBorder(clusters[i].box, measured, states.size());
  }
  std::stable_sort(clusters.begin(), clusters.end(), [](const Cluster& a, const Cluster& b) { return a.pixels > b.pixels; });
  return clusters;
}

int ClusterAt(const std::vector<Cluster>& clusters, const Eigen::Vector2d& pixel) {
  return Nearest(clusters, pixel, kClickRadius_px);
}

int ClusterNearestCentre(const std::vector<Cluster>& clusters) {
  if (clusters.empty()) return -1;
  const cv::Size image = clusters.front().mask.size();
  return Nearest(clusters, 0.5 * Eigen::Vector2d(image.width - 1, image.height - 1), 1e9);
}

}  // namespace vantage::segmentation
