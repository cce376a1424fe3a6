// The cracker box of `board`, learned from known poses and label masks: what the assessor works on, apart from tracking.
#pragma once

#include <memory>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "model/object_model.h"
#include "recognition/recogniser.h"
#include "rgbd/bop.h"
#include "support/data.h"

namespace vantage::testing {

class Board {
 public:
  static constexpr int kBoxId = 3;
  static constexpr int kBoxLabel = 1;

  Board() : scene(DataFolder() / "board") {}

  // The object's origin is near the middle of the box; axes as in its mesh.
  static geometry::Rigid MeshFromObject() {
    geometry::Rigid T = geometry::Rigid::Identity();
    T.translation() << -0.015, -0.014, 0.103;
    return T;
  }

  // True pose; nullopt where the frame does not show the box.
  std::optional<geometry::Rigid> TruePose(int id) const {
    for (const rgbd::ObjectTruth& truth : scene.Truth(id)) {
      if (truth.object_id == kBoxId) return truth.T_camera_object * MeshFromObject();
    }
    return std::nullopt;
  }

  cv::Mat Mask(int id) const { return scene.LoadLabel(id) == kBoxLabel; }

  // Adds the frame as a view; false where too little of the box is seen.
  bool AddView(int id, const features::FeatureParams& params, model::ObjectModel* object) const {
    const auto pose = TruePose(id);
    const cv::Mat mask = Mask(id);
    if (!pose || cv::countNonZero(mask) < 5000) return false;
    const rgbd::Frame frame = scene.Load(id);
    cv::Mat inner;
    cv::erode(mask, inner, cv::Mat(), cv::Point(-1, -1), 3);
    const features::Features all = features::Extract(rgbd::Gray(frame), inner, params);

    model::View view;
    view.id = static_cast<int>(object->views.size());
    view.frame_id = id;
    view.T_camera_object = *pose;
    const cv::Rect box = cv::boundingRect(mask);
    std::vector<int> kept;
    for (int k = 0; k < all.size(); ++k) {
      const Eigen::Vector2d pixel(all.keypoints[k].pt.x, all.keypoints[k].pt.y);
      const auto point = rgbd::PointAt(frame, pixel);
      const auto normal = rgbd::NormalAt(frame, pixel);
      if (!point || !normal) continue;
      view.points.push_back(static_cast<int>(object->points.size()));
      object->points.push_back({pose->inverse() * *point, pose->inverse().linear() * *normal});
      kept.push_back(k);
    }
    if (kept.size() < 20) return false;
    view.features = features::Select(all, kept);
    for (cv::KeyPoint& keypoint : view.features.keypoints) keypoint.pt -= cv::Point2f(box.tl());
    view.keyframe = frame;
    view.keyframe.color = frame.color(box).clone();
    view.keyframe.depth = frame.depth(box).clone();
    view.keyframe.camera = frame.camera.Cropped(box.x, box.y, box.width, box.height);
    view.mask = mask(box).clone();
    object->name = "cracker_box";
    object->feature_fingerprint = params.Fingerprint();
    object->views.push_back(view);
    return true;
  }

  rgbd::BopScene scene;
};

}  // namespace vantage::testing
