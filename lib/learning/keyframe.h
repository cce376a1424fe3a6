// Turns a frame with a known object pose into a new view of the model.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <tuple>
#include <vector>

#include "model/object_model.h"
#include "pose/dense.h"
#include "recognition/guided.h"
#include "segmentation/clusters.h"

namespace vantage::learning {

// The pose of a new object seen as this cluster: origin at the cluster's centroid, z along the table's normal, x along the world's
// x (the camera's where the world is not known) within the table.
geometry::Rigid FirstPose(const rgbd::Frame& frame, const segmentation::Plane& plane, const segmentation::Cluster& cluster);

// The cluster that shows the object: it holds most of the model's projected points. -1 where none holds half of those in the image.
int ClusterOfObject(const std::vector<segmentation::Cluster>& clusters, const model::ObjectModel& object,
                    const geometry::Rigid& T_camera_object, const geometry::PinholeCamera& camera);

// A copy of the model with one more view: the frame's features inside `mask` that have depth. Those in `links` keep the model point
// they were matched to, the others become new points. nullopt where fewer than `min_points` features have depth. `features` are
// those of the frame, pixels of the frame.
std::optional<model::ObjectModel> WithView(const model::ObjectModel& object, const rgbd::Frame& frame, const cv::Mat& mask,
                                           const features::Features& features, const geometry::Rigid& T_camera_object,
                                           const std::vector<recognition::GuidedMatch>& links, int min_points);

// About `count` points of the surface that a view's depth image shows, object frame. Empty where it has no depth.
std::vector<pose::SurfacePoint> SurfaceOfView(const model::View& view, int count);

// About `count` points of it where brightness changes, with the brightness the view's (smoothed) image has there, object frame.
// Fewer where the object is plain; empty where the view has no depth.
std::vector<pose::TexturePoint> TextureOfView(const model::View& view, int count);

// Both, of the views nearest to a pose, kept for the next time: what a view shows does not change in its camera's coordinates.
// Memory: about 50 bytes a sample and view. Not for several threads at once.
class AppearanceCache {
 public:
  // So many views are joined, and so many samples of all of them together.
  AppearanceCache(int views, int surface_samples, int texture_samples)
      : views_(views), surface_samples_(surface_samples), texture_samples_(texture_samples) {}

  // Object frame, views by rising angle to the pose.
  pose::Appearance Near(const model::ObjectModel& object, const geometry::Rigid& T_camera_object);

 private:
  const pose::Appearance& Of(const model::View& view, int count);

  int views_;
  int surface_samples_;
  int texture_samples_;
  std::map<std::tuple<int, std::int64_t, int>, pose::Appearance>
      known_;  // By the view's id and time and `count`; camera coordinates.
};

}  // namespace vantage::learning
