#include "learning/keyframe.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>

namespace vantage::learning {
namespace {

constexpr int kCropMargin = 16;     // Pixels of surroundings kept around the object.
constexpr float kMaskInset = 2.0f;  // Interest points nearer to the silhouette take their depth from the edge: left out...
constexpr float kSizesInset =
    1.0f;  // ...and so are those nearer to it than so many times their size: they are of the outline as much
           // as of the object, and stay with the outline as it turns (a pixel in 10 degrees on a can).

rgbd::Frame Crop(const rgbd::Frame& frame, const cv::Rect& area) {
  rgbd::Frame crop = frame;
  crop.color = frame.color(area).clone();
  crop.depth = frame.depth.empty() ? cv::Mat() : frame.depth(area).clone();
  crop.camera = frame.camera.Cropped(area.x, area.y, area.width, area.height);
  return crop;
}

}  // namespace

geometry::Rigid FirstPose(const rgbd::Frame& frame, const segmentation::Plane& plane, const segmentation::Cluster& cluster) {
  const Eigen::Vector3d up = plane.normal;
  Eigen::Vector3d along = Eigen::Vector3d::UnitX();
  if (frame.T_world_camera) along = frame.T_world_camera->linear().transpose() * Eigen::Vector3d::UnitX();
  along -= along.dot(up) * up;
  if (along.norm() < 1e-3) along = Eigen::Vector3d::UnitY() - up.y() * up;
  geometry::Rigid T_camera_object = geometry::Rigid::Identity();
  T_camera_object.linear().col(0) = along.normalized();
  T_camera_object.linear().col(1) = up.cross(along.normalized());
  T_camera_object.linear().col(2) = up;
  T_camera_object.translation() = cluster.centroid;
  return T_camera_object;
}

int ClusterOfObject(const std::vector<segmentation::Cluster>& clusters, const model::ObjectModel& object,
                    const geometry::Rigid& T_camera_object, const geometry::PinholeCamera& camera) {
  std::vector<cv::Point> pixels;
  for (const model::ModelPoint& point : object.points) {
    const auto pixel = camera.Project(T_camera_object * point.position);
    if (pixel && camera.Contains(*pixel)) pixels.emplace_back(std::lround(pixel->x()), std::lround(pixel->y()));
  }
  int best = -1;
  size_t most = pixels.size() / 2;
  for (size_t c = 0; c < clusters.size(); ++c) {
    const size_t inside =
        std::count_if(pixels.begin(), pixels.end(), [&](const cv::Point& p) { return clusters[c].mask.at<uchar>(p); });
    if (inside <= most) continue;
    most = inside;
    best = static_cast<int>(c);
  }
  return best;
}

std::optional<model::ObjectModel> WithView(const model::ObjectModel& object, const rgbd::Frame& frame, const cv::Mat& mask,
                                           const features::Features& features, const geometry::Rigid& T_camera_object,
                                           const std::vector<recognition::GuidedMatch>& links, int min_points) {
  cv::Mat bordered;
  cv::copyMakeBorder(mask, bordered, 1, 1, 1, 1, cv::BORDER_CONSTANT, cv::Scalar(0));  // The image's end is an outline too.
  cv::Mat_<float> inset;                                                               // Pixels from the silhouette.
  cv::distanceTransform(bordered, inset, cv::DIST_L2, cv::DIST_MASK_5);
  inset = inset(cv::Rect({1, 1}, mask.size()));
  std::map<int, int> linked_point;
  for (const recognition::GuidedMatch& link : links) linked_point[link.keypoint] = link.point;

  model::ObjectModel extended = object;
  model::View view;
  std::vector<int> chosen;
  const geometry::Rigid T_object_camera = T_camera_object.inverse();
  for (int k = 0; k < features.size(); ++k) {
    const cv::Point2f& at = features.keypoints[k].pt;
    const Eigen::Vector2d pixel(at.x, at.y);
    const float least_inset = std::max(kMaskInset, kSizesInset * features.keypoints[k].size);
    if (!frame.camera.Contains(pixel) || inset(cv::Point(std::lround(at.x), std::lround(at.y))) <= least_inset) continue;
    if (const auto link = linked_point.find(k); link != linked_point.end()) {
      chosen.push_back(k);
      view.points.push_back(link->second);
      continue;
    }
    const auto point = rgbd::PointAt(frame, pixel);
    const auto normal = rgbd::NormalAt(frame, pixel);
    if (!point || !normal) continue;
    chosen.push_back(k);
    view.points.push_back(static_cast<int>(extended.points.size()));
    extended.points.push_back({T_object_camera * *point, T_object_camera.linear() * *normal});
  }
  if (static_cast<int>(chosen.size()) < min_points) return std::nullopt;

  const cv::Rect box = cv::boundingRect(mask);
  const cv::Rect area =
      cv::Rect(box.x - kCropMargin, box.y - kCropMargin, box.width + 2 * kCropMargin, box.height + 2 * kCropMargin) &
      cv::Rect(0, 0, mask.cols, mask.rows);
  view.id = object.views.empty() ? 0 : object.views.back().id + 1;
  view.utime = frame.utime;
  view.frame_id = frame.id;
  view.T_camera_object = T_camera_object;
  view.keyframe = Crop(frame, area);
  view.mask = mask(area).clone();
  view.features = features::Select(features, chosen);
  for (cv::KeyPoint& keypoint : view.features.keypoints) keypoint.pt -= cv::Point2f(area.x, area.y);
  extended.views.push_back(std::move(view));
  return extended;
}

std::vector<pose::SurfacePoint> SurfaceOfView(const model::View& view, int count) {
  std::vector<pose::SurfacePoint> surface;
  if (view.keyframe.depth.empty()) return surface;
  const geometry::Rigid T_object_camera = view.T_camera_object.inverse();
  const int step = std::max(1, static_cast<int>(std::sqrt(double(cv::countNonZero(view.mask)) / std::max(1, count))));
  for (int y = step / 2; y < view.mask.rows; y += step) {
    for (int x = step / 2; x < view.mask.cols; x += step) {
      if (!view.mask.at<uchar>(y, x)) continue;
      const auto point = rgbd::PointAt(view.keyframe, {x, y}, 1);
      const auto normal = rgbd::NormalAt(view.keyframe, {x, y});
      if (point && normal) surface.push_back({T_object_camera * *point, T_object_camera.linear() * *normal});
    }
  }
  return surface;
}

std::vector<pose::TexturePoint> TextureOfView(const model::View& view, int count) {
  constexpr double kCandidates = 8.0;   // Pixels that are looked at for each point wanted.
  constexpr double kMinGradient = 4.0;  // Grey levels per pixel of the smoothed image.
  constexpr int kInset = 4;             // Nearer to the silhouette its smoothed image has some of the background.
  std::vector<pose::TexturePoint> texture;
  if (view.keyframe.depth.empty() || count <= 0) return texture;
  cv::Mat inside;
  cv::erode(view.mask, inside, cv::getStructuringElement(cv::MORPH_RECT, {2 * kInset + 1, 2 * kInset + 1}), {-1, -1}, 1,
            cv::BORDER_CONSTANT, cv::Scalar(0));
  const pose::SmoothImage image(view.keyframe, cv::Rect({0, 0}, view.mask.size()));
  std::vector<std::pair<Eigen::Vector2d, double>> edges;
  const int grid_px = std::max(1, static_cast<int>(std::sqrt(cv::countNonZero(inside) / (kCandidates * count))));
  for (int y = 0; y < inside.rows; y += grid_px) {
    for (int x = 0; x < inside.cols; x += grid_px) {
      if (!inside.at<uchar>(y, x)) continue;
      const auto sample = image.At({x, y});
      if (sample && sample->gradient.norm() >= kMinGradient) edges.emplace_back(Eigen::Vector2d(x, y), sample->brightness);
    }
  }
  const geometry::Rigid T_object_camera = view.T_camera_object.inverse();
  const double step = std::max(1.0, static_cast<double>(edges.size()) / count);
  for (double at = 0.0; at < static_cast<double>(edges.size()); at += step) {
    const auto& [pixel, brightness] = edges[static_cast<std::size_t>(at)];
    const auto point = rgbd::PointAt(view.keyframe, pixel, 1);
    const auto normal = rgbd::NormalAt(view.keyframe, pixel);
    if (point && normal && -normal->dot(point->normalized()) >= pose::kMinTextureCosine)
      texture.push_back({T_object_camera * *point, T_object_camera.linear() * *normal, brightness});
  }
  return texture;
}

const pose::Appearance& AppearanceCache::Of(const model::View& view, int count) {
  const auto [entry, is_new] = known_.try_emplace({view.id, view.utime, count});
  if (is_new) {
    model::View in_camera = view;
    in_camera.T_camera_object = geometry::Rigid::Identity();
    entry->second.surface = SurfaceOfView(in_camera, surface_samples_ / count);
    entry->second.textures.push_back(TextureOfView(in_camera, texture_samples_ / count));
  }
  return entry->second;
}

pose::Appearance AppearanceCache::Near(const model::ObjectModel& object, const geometry::Rigid& T_camera_object) {
  pose::Appearance appearance;
  if (known_.size() > 2 * object.views.size() + 8) known_.clear();  // Most are of views that are gone.
  const std::vector<int> nearest = model::NearestViews(object, T_camera_object, views_);
  for (const int index : nearest) {
    const model::View& view = object.views[index];
    const geometry::Rigid T_object_camera = view.T_camera_object.inverse();
    const pose::Appearance& in_camera = Of(view, static_cast<int>(nearest.size()));
    for (const pose::SurfacePoint& sample : in_camera.surface) {
      appearance.surface.push_back({T_object_camera * sample.point, T_object_camera.linear() * sample.normal});
    }
    appearance.textures.push_back(in_camera.textures.front());
    for (pose::TexturePoint& sample : appearance.textures.back()) {
      sample.point = T_object_camera * sample.point;
      sample.normal = T_object_camera.linear() * sample.normal;
    }
  }
  return appearance;
}

}  // namespace vantage::learning
