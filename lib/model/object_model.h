// The view-based object model: keyframes whose interest points have 3D positions on the object (section III).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "features/features.h"
#include "geometry/camera.h"
#include "geometry/rigid.h"
#include "measures/completeness.h"
#include "rgbd/frame.h"

namespace vantage::model {

// A surface point that one or more views have seen.
struct ModelPoint {
  Eigen::Vector3d position;  // Object frame, metres.
  Eigen::Vector3d normal;    // Object frame, unit, outward; from the view that added it.
};

// One keyframe. The images are the crop around the object (camera is the crop's), so that a view can be rendered from elsewhere.
struct View {
  int id = 0;                 // Unique in the object, ascending, never reused.
  std::int64_t utime = 0;     // Capture time.
  std::int64_t frame_id = 0;  // The source's frame number.
  geometry::Rigid T_camera_object = geometry::Rigid::Identity();
  rgbd::Frame keyframe;         // Crop: colour, depth, camera of the crop.
  cv::Mat mask;                 // CV_8UC1, 255 on the object; same size as the crop.
  features::Features features;  // On the object, pixels of the crop.
  std::vector<int> points;      // Model point of every keypoint (index into ObjectModel::points).

  measures::Viewpoint viewpoint() const;  // Direction and distance it was learned from.
};

struct ObjectModel {
  std::string name;  // Unique in a store.
  std::vector<ModelPoint> points;
  std::vector<View> views;
  measures::Measures measures;      // Own, pooled or default.
  std::string feature_fingerprint;  // Of the features the views were made with.

  // A copy that knows only this view (index into views) and the points it saw, with the same measures.
  ObjectModel OnlyView(int view) const;
  // A copy that knows only these views.
  ObjectModel OnlyViews(const std::vector<int>& views) const;
  std::vector<measures::Viewpoint> viewpoints() const;
  // Positions of all points, 3 x N, object frame, metres.
  Eigen::Matrix3Xd PointMatrix() const;
};

// Mean distance between the points under two poses: a detection is right where this is below 4 cm. Metres.
double MeanPointDistance(const Eigen::Matrix3Xd& points_in_object, const geometry::Rigid& T_camera_object_a,
                         const geometry::Rigid& T_camera_object_b);

}  // namespace vantage::model
