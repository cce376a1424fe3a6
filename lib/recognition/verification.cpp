#include "recognition/verification.h"

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <set>
#include <stdexcept>
#include <string>

#include "model/confidence.h"

namespace vantage::recognition {
namespace {

constexpr int kViews = 3;              // Nearest views whose points are held against the depth image.
constexpr double kMinCosine = 0.3;     // Of points that face the camera; slanted ones are next to the outline, where depth jumps.
constexpr int kMinMeasured = 8;        // Fewer measured points say nothing.
constexpr double kInside = 0.2;        // Radii of the object before its surface that still count as within it.
constexpr double kCellsAcross = 60.0;  // Squares over the image's width.
constexpr double kMinSupported = 0.1;  // Share of the measured points; less of an object is nothing of it.

// What a hypothesis covers of the image: the object's points that face the camera, and the convex hull of them.
struct Silhouette {
  std::vector<cv::Point2f> pixels;
  std::vector<double> depths_m;
  std::vector<cv::Point2f> hull;
  cv::Rect2f box;
  double radius_m = 0.0;  // Of the object.
};

Silhouette SilhouetteOf(const Hypothesis& hypothesis, const geometry::PinholeCamera& camera) {
  constexpr size_t kSamples = 1000;
  const auto& points = hypothesis.object->points;
  const size_t step = std::max<size_t>(1, points.size() / kSamples);
  Silhouette silhouette;
  Eigen::AlignedBox3d bounds;
  for (size_t i = 0; i < points.size(); i += step) {
    bounds.extend(points[i].position);
    const Eigen::Vector3d in_camera = hypothesis.T_camera_object * points[i].position;
    if ((hypothesis.T_camera_object.linear() * points[i].normal).dot(in_camera) >= 0.0) continue;
    const auto pixel = camera.Project(in_camera);
    if (!pixel) continue;
    silhouette.pixels.emplace_back(static_cast<float>(pixel->x()), static_cast<float>(pixel->y()));
    silhouette.depths_m.push_back(in_camera.z());
  }
  if (silhouette.pixels.size() >= 3) {
    cv::convexHull(silhouette.pixels, silhouette.hull);
    silhouette.box = cv::boundingRect(silhouette.hull);
  }
  if (!bounds.isEmpty()) silhouette.radius_m = 0.5 * bounds.diagonal().norm();
  return silhouette;
}

// Whether a point of the image at this depth would be behind or in the silhouette's object.
bool Hides(const Silhouette& silhouette, const Eigen::Vector2d& pixel, double depth_m) {
  const cv::Point2f p(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()));
  if (silhouette.hull.size() < 3 || !silhouette.box.contains(p) || cv::pointPolygonTest(silhouette.hull, p, false) < 0.0)
    return false;
  size_t nearest = 0;
  float distance = std::numeric_limits<float>::infinity();
  for (size_t i = 0; i < silhouette.pixels.size(); ++i) {
    const cv::Point2f d = silhouette.pixels[i] - p;
    if (d.dot(d) >= distance) continue;
    distance = d.dot(d);
    nearest = i;
  }
  return depth_m > silhouette.depths_m[nearest] - kInside * silhouette.radius_m;
}

int CountHidden(const Hypothesis& hypothesis, const Silhouette& by) {
  int hidden = 0;
  for (size_t i = 0; i < hypothesis.pixels.size(); ++i) hidden += Hides(by, hypothesis.pixels[i], hypothesis.depths_m[i]);
  return hidden;
}

// How much of the image the points explain: squares that hold one.
int Coverage(const Hypothesis& hypothesis, const geometry::PinholeCamera& camera) {
  const double cell_px = camera.width / kCellsAcross;
  std::set<std::pair<int, int>> cells;
  for (const Eigen::Vector2d& pixel : hypothesis.pixels) {
    cells.emplace(static_cast<int>(pixel.x() / cell_px), static_cast<int>(pixel.y() / cell_px));
  }
  return static_cast<int>(cells.size());
}

// One that was taken.
struct Taken {
  const Hypothesis* hypothesis;
  const Silhouette* silhouette;
};

// Mean distance of some of the object's points under two poses.
double MeanDistance(const model::ObjectModel& object, const geometry::Rigid& a, const geometry::Rigid& b) {
  constexpr size_t kSamples = 200;
  const size_t step = std::max<size_t>(1, object.points.size() / kSamples);
  double sum = 0.0;
  int count = 0;
  for (size_t i = 0; i < object.points.size(); i += step, ++count) {
    sum += (a * object.points[i].position - b * object.points[i].position).norm();
  }
  return count > 0 ? sum / count : 0.0;
}

// Interest points that speak for the hypothesis beside what was taken.
int CountOwn(const Hypothesis& hypothesis, const Silhouette& silhouette, const std::vector<Taken>& taken,
             const std::set<int>& explained) {
  int own = 0;
  for (size_t i = 0; i < hypothesis.keypoints.size(); ++i) {
    const bool claimed =
        explained.count(hypothesis.keypoints[i]) > 0 || std::any_of(taken.begin(), taken.end(), [&](const Taken& other) {
          return Hides(*other.silhouette, hypothesis.pixels[i], hypothesis.depths_m[i]);
        });
    own += !claimed;
  }
  for (const Taken& other : taken) own -= CountHidden(*other.hypothesis, silhouette);
  return own;
}

}  // namespace

void VerificationParams::Check() const {
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(std::string("verification: ") + what);
  };
  require(max_seen_through >= 0.0 && max_seen_through <= 1.0, "max_seen_through must be in [0, 1]");
  require(merge_distance >= 0.0, "merge_distance must be >= 0");
  require(min_own_share >= 0.0 && min_own_share <= 1.0, "min_own_share must be in [0, 1]");
  require(max_instances >= 1, "max_instances must be >= 1");
}

DepthEvidence CompareDepth(const model::ObjectModel& object, const geometry::Rigid& T_camera_object, const rgbd::Frame& frame,
                           double max_depth_error_m) {
  DepthEvidence evidence;
  if (frame.depth.empty()) return evidence;
  std::set<int> points;
  for (const int view : model::NearestViews(object, T_camera_object, kViews)) {
    points.insert(object.views[view].points.begin(), object.views[view].points.end());
  }
  for (const int i : points) {
    const model::ModelPoint& point = object.points[i];
    const Eigen::Vector3d in_camera = T_camera_object * point.position;
    if (-(T_camera_object.linear() * point.normal).dot(in_camera.normalized()) < kMinCosine) continue;
    const auto pixel = frame.camera.Project(in_camera);
    const auto depth_m = pixel ? rgbd::DepthAt(frame, *pixel, 1) : std::nullopt;
    if (!depth_m) continue;
    const double behind_m = *depth_m - in_camera.z();
    ++(behind_m > max_depth_error_m ? evidence.seen_through : behind_m < -max_depth_error_m ? evidence.hidden : evidence.supported);
  }
  return evidence;
}

bool IsContradicted(const DepthEvidence& evidence, const VerificationParams& params) {
  const int measured = evidence.supported + evidence.hidden + evidence.seen_through;
  if (measured < kMinMeasured) return false;
  const int visible = evidence.supported + evidence.seen_through;
  return evidence.supported < kMinSupported * measured || evidence.seen_through > params.max_seen_through * visible;
}

std::vector<int> ResolveConflicts(const std::vector<Hypothesis>& hypotheses, const geometry::PinholeCamera& camera, int min_points,
                                  const VerificationParams& params) {
  std::vector<Silhouette> silhouettes;
  std::vector<std::pair<int, size_t>> coverage;  // Equal: more points first.
  for (const Hypothesis& hypothesis : hypotheses) {
    silhouettes.push_back(SilhouetteOf(hypothesis, camera));
    coverage.emplace_back(Coverage(hypothesis, camera), hypothesis.keypoints.size());
  }
  std::vector<int> order(hypotheses.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return coverage[a] > coverage[b]; });
  std::vector<int> kept;
  std::vector<Taken> taken;
  std::set<int> explained;
  std::map<const model::ObjectModel*, int> instances;
  for (const int i : order) {
    const Hypothesis& hypothesis = hypotheses[i];
    const bool repeated = std::any_of(taken.begin(), taken.end(), [&](const Taken& other) {
      return other.hypothesis->object == hypothesis.object &&
             MeanDistance(*hypothesis.object, hypothesis.T_camera_object, other.hypothesis->T_camera_object) <
                 params.merge_distance * silhouettes[i].radius_m;
    });
    if (repeated || instances[hypothesis.object] >= params.max_instances) continue;
    const int own = CountOwn(hypothesis, silhouettes[i], taken, explained);
    if (own < min_points || own < params.min_own_share * hypothesis.keypoints.size()) continue;
    ++instances[hypothesis.object];
    explained.insert(hypothesis.keypoints.begin(), hypothesis.keypoints.end());
    taken.push_back({&hypothesis, &silhouettes[i]});
    kept.push_back(i);
  }
  return kept;
}

}  // namespace vantage::recognition
