#include "model/confidence.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>

namespace vantage::model {
namespace {

// Whether a point faces the camera and nothing nearer is measured in front of it: it ought to be seen there if the pose is right.
bool OughtToBeSeen(const ModelPoint& point, const Eigen::Vector3d& in_camera, const std::optional<Eigen::Vector2d>& pixel,
                   const geometry::Rigid& T_camera_object, const rgbd::Frame& frame, const ConfidenceParams& params) {
  const Eigen::Vector3d normal = T_camera_object.linear() * point.normal;
  if (-normal.dot(in_camera.normalized()) < std::cos(params.max_incidence_deg * M_PI / 180.0)) return false;
  const auto depth = pixel ? rgbd::DepthAt(frame, *pixel, 0) : std::nullopt;
  return !depth || *depth >= in_camera.z() - params.occlusion_m;
}

}  // namespace

void ConfidenceParams::Check() const {
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(std::string("confidence: ") + what);
  };
  require(support_px > 0.0, "support_px must be > 0");
  require(max_scale_ratio > 1.0, "max_scale_ratio must be > 1");
  require(max_incidence_deg > 0.0 && max_incidence_deg <= 90.0, "max_incidence_deg must be in (0, 90]");
  require(occlusion_m > 0.0, "occlusion_m must be > 0");
  require(min_points >= 1, "min_points must be >= 1");
  require(max_views >= 1, "max_views must be >= 1");
}

std::string ConfidenceParams::Fingerprint() const {
  return std::to_string(support_px) + ":" + std::to_string(max_scale_ratio) + ":" + std::to_string(max_incidence_deg) + ":" +
         std::to_string(min_points);
}

KeypointGrid::KeypointGrid(const std::vector<cv::KeyPoint>& keypoints, int width, int height, double cell_px)
    : columns_(static_cast<int>(width / cell_px) + 1), rows_(static_cast<int>(height / cell_px) + 1), cell_px_(cell_px) {
  cells_.resize(static_cast<size_t>(columns_) * rows_);
  for (const cv::KeyPoint& keypoint : keypoints) {
    const int column = std::clamp(static_cast<int>(keypoint.pt.x / cell_px_), 0, columns_ - 1);
    const int row = std::clamp(static_cast<int>(keypoint.pt.y / cell_px_), 0, rows_ - 1);
    cells_[row * columns_ + column].push_back(static_cast<int>(points_.size()));
    points_.push_back(keypoint.pt);
    sizes_.push_back(keypoint.size);
  }
}

std::vector<int> KeypointGrid::Near(const Eigen::Vector2d& pixel, double radius_px) const {
  std::vector<int> near;
  const auto cell = [this](double value, int limit) {
    return std::clamp(static_cast<int>(std::floor(value / cell_px_)), 0, limit);
  };
  for (int row = cell(pixel.y() - radius_px, rows_ - 1); row <= cell(pixel.y() + radius_px, rows_ - 1); ++row) {
    for (int column = cell(pixel.x() - radius_px, columns_ - 1); column <= cell(pixel.x() + radius_px, columns_ - 1); ++column) {
      for (const int i : cells_[row * columns_ + column]) {
        if (std::hypot(points_[i].x - pixel.x(), points_[i].y - pixel.y()) <= radius_px) near.push_back(i);
      }
    }
  }
  return near;
}

bool KeypointGrid::HasNear(const Eigen::Vector2d& pixel, double radius_px, double size, double max_scale_ratio) const {
  const std::vector<int> near = Near(pixel, radius_px);
  return std::any_of(near.begin(), near.end(),
                     [&](int i) { return sizes_[i] < size * max_scale_ratio && size < sizes_[i] * max_scale_ratio; });
}

Confidence ViewConfidence(const ObjectModel& model, int view, const geometry::Rigid& T_camera_object, const rgbd::Frame& frame,
                          const KeypointGrid& keypoints, const ConfidenceParams& params) {
  Confidence confidence;
  confidence.view = view;
  const View& seen = model.views[view];
  const double zoom = frame.camera.fx / seen.keyframe.camera.fx;
  for (size_t k = 0; k < seen.points.size(); ++k) {
    const ModelPoint& point = model.points[seen.points[k]];
    const Eigen::Vector3d in_camera = T_camera_object * point.position;
    const auto pixel = frame.camera.Project(in_camera);
    if (!OughtToBeSeen(point, in_camera, pixel, T_camera_object, frame, params)) continue;
    ++confidence.visible;
    if (!pixel || !frame.camera.Contains(*pixel)) continue;  // Outside the image nothing speaks for the pose.
    const double nearer = (seen.T_camera_object * point.position).z() / in_camera.z();
    const double size = seen.features.keypoints[k].size * zoom * nearer;
    confidence.support += keypoints.HasNear(*pixel, params.support_px, size, params.max_scale_ratio);
  }
  if (confidence.visible >= params.min_points) confidence.value = double(confidence.support) / confidence.visible;  // Equation (1)
  return confidence;
}

std::vector<int> NearestViews(const ObjectModel& model, const geometry::Rigid& T_camera_object, int count) {
  const Eigen::Vector3d direction = geometry::ViewDirection(T_camera_object);
  std::vector<double> angles;
  for (const View& view : model.views) angles.push_back(geometry::AngleBetween(direction, view.viewpoint().direction));
  std::vector<int> order(model.views.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return angles[a] < angles[b]; });
  if (static_cast<int>(order.size()) > count) order.resize(count);
  return order;
}

Confidence ObjectConfidence(const ObjectModel& model, const geometry::Rigid& T_camera_object, const rgbd::Frame& frame,
                            const KeypointGrid& keypoints, const ConfidenceParams& params) {
  Confidence best;
  for (const int view : NearestViews(model, T_camera_object, params.max_views)) {
    const Confidence confidence = ViewConfidence(model, view, T_camera_object, frame, keypoints, params);
    const bool first =
        best.view < 0 && confidence.visible >= params.min_points;   // It says something, if only that nothing is seen.
    if (first || confidence.value > best.value) best = confidence;  // Equation (2)
  }
  return best;
}

}  // namespace vantage::model
