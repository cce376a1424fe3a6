#include "segmentation/clusters.h"
#include "segmentation/creases.h"
#include "segmentation/joining.h"

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

constexpr double kFloorShare = 0.3, kFloorHeight_m = 0.002;
constexpr double kClickRadius_px = 20.0;
constexpr int kPiecesPerObject = 8;  // A piece this much smaller than an object may still be joined to one.

void Require(bool ok, const char* what, double found) {
  if (!ok) throw std::invalid_argument(std::string("clusters: ") + what + ", is " + std::to_string(found));
}

// The surfaces that may be (pieces of) objects, joined to objects.
std::vector<Part> FindParts(const rgbd::Frame& frame, const cv::Mat& states, const cv::Mat& cloud, const Plane& plane,
                            const ClusterParams& params) {
  const cv::Rect box = cv::boundingRect(states == kAbove);  // Mostly far less than the frame.
  if (box.empty()) return {};
  const Surfaces surfaces =
      PartAtCreases(states(box).clone(), cloud(box).clone(), frame.camera.Cropped(box.x, box.y, box.width, box.height), params);
  std::vector<std::vector<cv::Point>> members(surfaces.count + 1);
  for (int y = 0; y < box.height; ++y)
    for (int x = 0; x < box.width; ++x)
      if (const int label = surfaces.labels.at<int>(y, x)) members[label].emplace_back(box.x + x, box.y + y);
  std::vector<Part> parts;
  for (int label = 1; label <= surfaces.count; ++label) {
    if (static_cast<int>(members[label].size()) * kPiecesPerObject < params.min_pixels) continue;
    std::vector<Eigen::Vector3d> points;
    points.reserve(members[label].size());
    for (const cv::Point& pixel : members[label]) {
      const cv::Vec3f& p = cloud.at<cv::Vec3f>(pixel);
      points.emplace_back(p[0], p[1], p[2]);
    }
    if (LongestSide(points) > params.max_size_m) continue;
    parts.push_back(MakePart(std::move(members[label]), std::move(points), plane));
    parts.back().surfaces = {label};
  }
  JoinParts(frame, states, cloud, surfaces.in_crease, params, &parts);
  return parts;
}

// What lies within the mask's outline and counts as table, but is the floor of a vessel: its surface goes on in the mask's, and it
// lies higher than the table.
cv::Mat FloorsWithin(const cv::Mat& filled, const cv::Mat& mask, const cv::Mat& states, const cv::Mat& cloud, const Plane& plane,
                     const ClusterParams& params) {
  cv::Mat floors(mask.size(), CV_8UC1, cv::Scalar(0)), labels;
  const int count = cv::connectedComponents(filled & (states == kOther) & ~mask, labels, 8, CV_32S);
  struct Hole {
    int pixels = 0, pairs = 0, continuous = 0;
    double height_m = 0.0;
  };
  std::vector<Hole> holes(count);
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      const int label = labels.at<int>(y, x);
      if (label == 0) continue;
      const cv::Vec3f& p = cloud.at<cv::Vec3f>(y, x);
      Hole& hole = holes[label];
      ++hole.pixels;
      hole.height_m += plane.Height({p[0], p[1], p[2]});
      for (const cv::Point& direction : {cv::Point(1, 0), cv::Point(-1, 0), cv::Point(0, 1), cv::Point(0, -1)}) {
        for (int step = 1; step <= params.bridge_px + 1; ++step) {
          const cv::Point to(x + step * direction.x, y + step * direction.y);
          if (to.x < 0 || to.y < 0 || to.x >= labels.cols || to.y >= labels.rows || labels.at<int>(to) == label) break;
          if (!mask.at<std::uint8_t>(to)) continue;
          ++hole.pairs;
          hole.continuous += std::abs(cloud.at<cv::Vec3f>(to)[2] - p[2]) <= JumpAt(p[2], params);
          break;
        }
      }
    }
  }
  for (int label = 1; label < count; ++label) {
    const Hole& hole = holes[label];
    if (hole.continuous >= kFloorShare * hole.pairs && hole.height_m >= kFloorHeight_m * hole.pixels)
      floors.setTo(255, labels == label);
  }
  return floors;
}

// Closes the mask (of part pixels; region of the frame): gaps up to the bridge's width, and holes inside it where nothing was
// measured or a vessel's floor was. `blocked` pixels (the table, other clusters) stay out: a hole through which the table is seen
// is a hole.
void CloseHoles(cv::Mat& mask, const cv::Mat& others, const cv::Mat& states, const cv::Mat& cloud, const Plane& plane,
                const ClusterParams& params) {
  const int side = 2 * params.bridge_px + 1;
  const cv::Mat kernel = cv::getStructuringElement(cv::MORPH_ELLIPSE, cv::Size(side, side));
  cv::Mat closed;
  cv::morphologyEx(mask, closed, cv::MORPH_CLOSE, kernel, cv::Point(-1, -1), 1, cv::BORDER_CONSTANT, cv::Scalar(0));
  std::vector<std::vector<cv::Point>> outlines;
  cv::findContours(closed, outlines, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  cv::drawContours(closed, outlines, -1, cv::Scalar(255), cv::FILLED);
  const cv::Mat floors = FloorsWithin(closed, mask, states, cloud, plane, params);
  closed.setTo(0, ((states == kOther) & ~floors) | others);
  mask |= closed;
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
  Require(std::isfinite(crease_arm_m) && crease_arm_m > 0.0, "crease_arm_m must be > 0", crease_arm_m);
  Require(min_crease_deg >= 20.0 && min_crease_deg <= 180.0, "min_crease_deg must be in [20, 180]", min_crease_deg);
  Require(std::isfinite(min_part_m) && min_part_m > 0.0, "min_part_m must be > 0", min_part_m);
  Require(std::isfinite(min_crease_share) && min_crease_share > 0.0, "min_crease_share must be > 0", min_crease_share);
  Require(std::isfinite(min_size_m) && min_size_m > 0.0, "min_size_m must be > 0", min_size_m);
  Require(max_size_m > min_size_m, "max_size_m must be > min_size_m", max_size_m);
  Require(min_pixels >= 1, "min_pixels must be >= 1", min_pixels);
}

std::vector<Cluster> FindClusters(const rgbd::Frame& frame, const Plane& plane, const ClusterParams& params) {
  params.Check();
  if (frame.depth.empty()) return {};
  const cv::Mat cloud = rgbd::OrganisedCloud(frame);
  const cv::Mat states = Classify(cloud, plane, params);
  const std::vector<Part> parts = FindParts(frame, states, cloud, plane, params);

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
    const cv::Rect seen = cv::boundingRect(clusters[i].mask);
    const cv::Point margin(params.bridge_px + 1, params.bridge_px + 1);
    const cv::Rect around = cv::Rect(seen.tl() - margin, seen.br() + margin) & cv::Rect({}, states.size());
    const int label = static_cast<int>(i) + 1;
    cv::Mat mask = clusters[i].mask(around);
    CloseHoles(mask, (labels(around) != label) & (labels(around) != 0), states(around), cloud(around), plane, params);
    clusters[i].box = cv::boundingRect(mask) + around.tl();
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
