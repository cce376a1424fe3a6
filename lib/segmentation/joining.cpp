#include "segmentation/joining.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "segmentation/components.h"

namespace vantage::segmentation {
namespace {

constexpr std::size_t kFootprintSamples = 500;  // So many points of a part tell a share.

constexpr double kWithinAtCrease = 0.6;  // Share of a part within one that it meets in a crease: beside each other is not within.

// Inside and outside of a vessel.
constexpr float kRim_m = 0.015;          // How far down the rim reaches.
constexpr double kSameHeight_m = 0.015;  // Of the two sides' rims.
constexpr double kRimWidth = 0.12;       // Rim points lie so near the outline seen from above, over its size...
constexpr double kRimShare = 0.8;        // ...for so many of them: a vessel is open above.
constexpr double kLeastSagitta = 0.15;   // How far the far side bulges away, over its width.
constexpr double kLargestGap_rad = 1.1;  // In the rim, seen from its middle.
constexpr std::size_t kLeastRim = 20;    // Points.

// What is not seen in between.
constexpr std::size_t kNormalSamples = 100;  // Of a part.
constexpr int kNormalRadius_px = 5;
constexpr double kSameNormal = 0.96;          // Cosine.
constexpr double kSamePlane_m = 0.008;        // A point to a tangent plane of the other's in which the surface goes on...
constexpr double kContinued = 0.4;            // ...for so many of the smaller one's (of two faces one may be hidden).
constexpr double kContinuedOverGap = 0.8;     // Where nothing nearer hides the gap, neighbours that stand in line must not be one.
constexpr double kOutside_m = 0.015;          // Beyond a tangent plane: no convex body...
constexpr double kOutsidePerDistance = 0.07;  // ...more at a distance: normals are some degrees off.
constexpr double kConvex = 0.85;              // ...if so few pairs are within.

// What floats.
constexpr double kFloating_m = 0.015;  // Above the table.
constexpr double kOpenShare = 0.8;     // Of its columns, under which farther things are seen.
constexpr int kBeside_px = 8;
constexpr float kBeside_m = 0.04;

// Whether enough of `inner` lies within `outer`, seen from above and seen from the side.
bool LiesWithin(const Part& inner, const Part& outer, double share) {
  const double common_m = std::min(inner.high_m, outer.high_m) - std::max(inner.low_m, outer.low_m);
  if (common_m < share * (inner.high_m - inner.low_m)) return false;
  if (outer.hull_cm.size() < 3) return false;
  const std::size_t stride = 1 + inner.footprint_cm.size() / kFootprintSamples;
  int inside = 0, tested = 0;
  for (std::size_t i = 0; i < inner.footprint_cm.size(); i += stride, ++tested)
    inside += cv::pointPolygonTest(outer.hull_cm, inner.footprint_cm[i], false) >= 0.0;
  return inside >= share * tested;
}

bool Meet(const Part& a, const Part& b, const std::set<std::pair<int, int>>& in_crease) {
  for (const int i : a.surfaces)
    for (const int k : b.surfaces)
      if (in_crease.count({std::min(i, k), std::max(i, k)}) > 0) return true;
  return false;
}

bool MeetsAny(const Part& part, const std::set<std::pair<int, int>>& in_crease) {
  return std::any_of(in_crease.begin(), in_crease.end(), [&part](const std::pair<int, int>& pair) {
    return std::count(part.surfaces.begin(), part.surfaces.end(), pair.first) +
               std::count(part.surfaces.begin(), part.surfaces.end(), pair.second) >
           0;
  });
}

// --- Inside and outside of a vessel ---

// The part's highest points, seen from above.
std::vector<cv::Point2f> RimOf(const Part& part) {
  std::vector<cv::Point2f> rim;
  for (std::size_t i = 0; i < part.heights_m.size(); ++i)
    if (part.heights_m[i] >= part.top_m - kRim_m) rim.push_back(part.footprint_cm[i]);
  return rim;
}

cv::Point2f MeanOf(const std::vector<cv::Point2f>& points) {
  cv::Point2f sum(0, 0);
  for (const cv::Point2f& point : points) sum += point;
  return sum / static_cast<float>(points.size());
}

// By how far the points' middle third bulges along `away` (a unit vector) from the chord between their ends, over its length.
double Sagitta(const std::vector<cv::Point2f>& points, const cv::Point2f& away) {
  const cv::Point2f across(-away.y, away.x);
  const auto [left, right] = std::minmax_element(
      points.begin(), points.end(), [&](const cv::Point2f& a, const cv::Point2f& b) { return a.dot(across) < b.dot(across); });
  const double width = (*right - *left).dot(across);
  if (width <= 0.0) return 0.0;
  double sum = 0.0;
  int count = 0;
  for (const cv::Point2f& point : points) {
    const double along = (point - *left).dot(across) / width;
    if (along < 1.0 / 3.0 || along > 2.0 / 3.0) continue;
    sum += point.dot(away);
    ++count;
  }
  return count > 0 ? (sum / count - 0.5 * (left->dot(away) + right->dot(away))) / width : 0.0;
}

// Whether the rim is closed all round, and nothing of it is inside.
bool IsClosedAndEmpty(const std::vector<cv::Point2f>& rim) {
  std::vector<cv::Point2f> hull;
  cv::convexHull(rim, hull);
  const double width_cm = std::max(1.0, kRimWidth * std::sqrt(cv::contourArea(hull)));
  const cv::Point2f middle = MeanOf(hull);
  int on_outline = 0;
  std::vector<double> angles;
  for (const cv::Point2f& point : rim) {
    on_outline += cv::pointPolygonTest(hull, point, true) <= width_cm;
    angles.push_back(std::atan2(point.y - middle.y, point.x - middle.x));
  }
  std::sort(angles.begin(), angles.end());
  double gap = angles.front() + 2.0 * M_PI - angles.back();
  for (std::size_t i = 1; i < angles.size(); ++i) gap = std::max(gap, angles[i] - angles[i - 1]);
  return on_outline >= kRimShare * static_cast<double>(rim.size()) && gap <= kLargestGap_rad;
}

bool IsVessel(const Part& near, const Part& far) {
  if (std::abs(near.top_m - far.top_m) > kSameHeight_m) return false;
  std::vector<cv::Point2f> rim = RimOf(near);
  const std::vector<cv::Point2f> far_rim = RimOf(far);
  if (rim.size() < kLeastRim || far_rim.size() < kLeastRim) return false;
  const cv::Point2f away = MeanOf(far_rim) - MeanOf(rim);
  const float distance = std::hypot(away.x, away.y);
  if (distance <= 0.0f || Sagitta(far_rim, away / distance) < kLeastSagitta) return false;
  rim.insert(rim.end(), far_rim.begin(), far_rim.end());
  return IsClosedAndEmpty(rim);
}

// --- What is not seen in between ---

struct SurfacePoint {
  Eigen::Vector3d point, normal;
};

std::vector<SurfacePoint> SamplesOf(const rgbd::Frame& frame, const Part& part) {
  std::vector<SurfacePoint> samples;
  const std::size_t stride = 1 + part.pixels.size() / kNormalSamples;
  for (std::size_t i = stride / 2; i < part.pixels.size(); i += stride)
    if (const auto normal = rgbd::NormalAt(frame, {part.pixels[i].x, part.pixels[i].y}, kNormalRadius_px))
      samples.push_back({part.points[i], *normal});
  return samples;
}

// Share of a's samples that lie in the tangent plane of one of b's and face as it does.
double ContinuedShare(const std::vector<SurfacePoint>& a, const std::vector<SurfacePoint>& b) {
  if (a.empty()) return 0.0;
  const auto continued = [&b](const SurfacePoint& p) {
    return std::any_of(b.begin(), b.end(), [&p](const SurfacePoint& q) {
      return p.normal.dot(q.normal) >= kSameNormal &&
             std::abs((p.normal + q.normal).normalized().dot(p.point - q.point)) <= kSamePlane_m;
    });
  };
  return static_cast<double>(std::count_if(a.begin(), a.end(), continued)) / static_cast<double>(a.size());
}

// Share of the pairs of samples of which neither lies outside the other's tangent plane: all, on a convex body.
double ConvexShare(const std::vector<SurfacePoint>& a, const std::vector<SurfacePoint>& b) {
  if (a.empty() || b.empty()) return 0.0;
  int count = 0;
  for (const SurfacePoint& p : a)
    for (const SurfacePoint& q : b)
      count += std::max(p.normal.dot(q.point - p.point), q.normal.dot(p.point - q.point)) <=
               kOutside_m + kOutsidePerDistance * (p.point - q.point).norm();
  return count / static_cast<double>(a.size() * b.size());
}

cv::Point2d MiddlePixel(const Part& part) {
  cv::Point2d sum(0, 0);
  for (const cv::Point& pixel : part.pixels) sum += cv::Point2d(pixel);
  return sum / static_cast<double>(part.pixels.size());
}

// What is seen between the parts' middles.
struct Between {
  int nearer = 0, unknown = 0, others = 0;  // Pixels.
};

Between LookBetween(const cv::Mat& labels, const cv::Mat& cloud, const Part& a, const Part& b, const ClusterParams& params) {
  const cv::Point2d from = MiddlePixel(a), to = MiddlePixel(b);
  const double from_z = Centroid(a.points).z(), to_z = Centroid(b.points).z();
  const int steps = std::max(1, static_cast<int>(std::ceil(std::max(std::abs(to.x - from.x), std::abs(to.y - from.y)))));
  Between result;
  for (int i = 0; i <= steps; ++i) {
    const double share = i / static_cast<double>(steps);
    const cv::Point pixel(cvRound(from.x + share * (to.x - from.x)), cvRound(from.y + share * (to.y - from.y)));
    const int label = labels.at<int>(pixel);
    if (label == a.surfaces.front() || label == b.surfaces.front()) continue;
    const float z = cloud.at<cv::Vec3f>(pixel)[2];
    if (std::isnan(z))
      ++result.unknown;
    else
      ++(z < from_z + share * (to_z - from_z) - JumpAt(z, params) ? result.nearer : result.others);
  }
  return result;
}

// Behind something nearer, or across a gap in which nothing was measured, as on dark and shiny parts.
bool GoesOnUnseen(const rgbd::Frame& frame, const cv::Mat& labels, const cv::Mat& cloud, const Part& a, const Part& b,
                  const ClusterParams& params) {
  const Between between = LookBetween(labels, cloud, a, b, params);
  if (between.nearer + between.unknown == 0 || between.others > (between.nearer + between.unknown) / 10) return false;
  const auto larger = SamplesOf(frame, a), smaller = SamplesOf(frame, b);
  const double least = between.nearer > between.unknown ? kContinued : kContinuedOverGap;
  return ContinuedShare(smaller, larger) >= least && ConvexShare(smaller, larger) >= kConvex;
}

// --- What floats ---

// Whether the part is seen to end above the table: nearly all of its columns end before something farther away.
bool Floats(const cv::Mat& states, const cv::Mat& cloud, const Part& part) {
  if (part.low_m < kFloating_m) return false;
  std::vector<int> lowest(states.cols, -1);
  for (const cv::Point& pixel : part.pixels) lowest[pixel.x] = std::max(lowest[pixel.x], pixel.y);
  int columns = 0, open = 0;
  for (int x = 0; x < states.cols; ++x) {
    if (lowest[x] < 0) continue;
    ++columns;
    const float z = cloud.at<cv::Vec3f>(lowest[x], x)[2];
    int y = lowest[x] + 1;
    const int end = std::min(states.rows, y + kBeside_px);
    while (y < end && states.at<std::uint8_t>(y, x) == kUnknown) ++y;
    open += y < end && states.at<std::uint8_t>(y, x) == kOther && cloud.at<cv::Vec3f>(y, x)[2] > z;
  }
  return open >= kOpenShare * columns;
}

bool IsBeside(const cv::Mat& labels, const cv::Mat& cloud, const Part& part, const Part& other) {
  const int label = other.surfaces.front();
  for (const cv::Point& pixel : part.pixels) {
    const float z = cloud.at<cv::Vec3f>(pixel)[2];
    for (const cv::Point& step : {cv::Point(1, 0), cv::Point(-1, 0), cv::Point(0, 1), cv::Point(0, -1)}) {
      const cv::Point to = pixel + kBeside_px * step;
      if (to.x < 0 || to.y < 0 || to.x >= labels.cols || to.y >= labels.rows) continue;
      for (cv::Point at = pixel + step; at != to; at += step)
        if (labels.at<int>(at) == label && std::abs(cloud.at<cv::Vec3f>(at)[2] - z) <= kBeside_m) return true;
    }
  }
  return false;
}

}  // namespace

void JoinParts(const rgbd::Frame& frame, const cv::Mat& states, const cv::Mat& cloud,
               const std::set<std::pair<int, int>>& in_crease, const ClusterParams& params, std::vector<Part>* parts) {
  if (params.merge_share > 1.0) return;
  std::stable_sort(parts->begin(), parts->end(), [](const Part& a, const Part& b) { return a.pixels.size() > b.pixels.size(); });
  cv::Mat labels(states.size(), CV_32SC1, cv::Scalar(0));  // A part's is the first of its surfaces.
  const auto paint = [&labels](const Part& part, int label) {
    for (const cv::Point& pixel : part.pixels) labels.at<int>(pixel) = label;
  };
  for (const Part& part : *parts) paint(part, part.surfaces.front());
  const auto belong = [&](const Part& larger, const Part& smaller) {
    const double share = Meet(larger, smaller, in_crease) ? std::max(params.merge_share, kWithinAtCrease) : params.merge_share;
    if (LiesWithin(smaller, larger, share) || LiesWithin(larger, smaller, share)) return true;
    const bool larger_is_nearer = Centroid(larger.points).z() < Centroid(smaller.points).z();
    if (larger_is_nearer ? IsVessel(larger, smaller) : IsVessel(smaller, larger)) return true;
    if (GoesOnUnseen(frame, labels, cloud, larger, smaller, params)) return true;
    return !MeetsAny(smaller, in_crease) && Floats(states, cloud, smaller) && IsBeside(labels, cloud, smaller, larger);
  };
  for (std::size_t i = 0; i < parts->size(); ++i) {
    for (std::size_t k = i + 1; k < parts->size(); ++k) {
      Part &larger = (*parts)[i], &smaller = (*parts)[k];
      if (!belong(larger, smaller)) continue;
      Part both = Join(larger, smaller);
      if (LongestSide(both.points) > params.max_size_m) continue;
      paint(smaller, larger.surfaces.front());
      larger = std::move(both);
      parts->erase(parts->begin() + static_cast<std::ptrdiff_t>(k));
      k = i;  // The larger hull may hold a part that was passed over.
    }
  }
}

}  // namespace vantage::segmentation
