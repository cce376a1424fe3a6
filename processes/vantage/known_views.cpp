#include "vantage/known_views.h"

#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "learning/keyframe.h"
#include "vantage/sequence.h"

namespace vantage::cli {
namespace {

constexpr int kMinViewPoints = 20;
constexpr int kLabelBorder = 3;   // Pixels of the label's border that are not learned: edges against the background.
constexpr int kSurfaceStep = 12;  // Every so manieth pixel of every so manieth row is a point of the true surface.
const char* const kName = "object";

}  // namespace

KnownObject::KnownObject(const rgbd::BopScene& scene, int object_id) : scene_(scene), object_id_(object_id) {
  const auto label = LabelOfObject(scene, object_id);
  if (!label) throw std::runtime_error(scene.folder().string() + ": has no label/; learning at known poses needs it");
  label_ = *label;
}

cv::Mat KnownObject::Mask(int id) const { return scene_.LoadLabel(id) == label_; }

std::optional<geometry::Rigid> KnownObject::TruePose(int id) const { return TruthOf(scene_, id, object_id_); }

Eigen::Matrix3Xd KnownObject::Surface(const std::vector<int>& ids) const {
  std::vector<Eigen::Vector3d> points;
  for (const int id : ids) {
    const auto T_camera_mesh = TruePose(id);
    if (!T_camera_mesh) continue;
    const rgbd::Frame frame = scene_.Load(id);
    const cv::Mat mask = Mask(id);
    for (int y = 0; y < mask.rows && !frame.depth.empty(); y += kSurfaceStep) {
      for (int x = 0; x < mask.cols; x += kSurfaceStep) {
        if (mask.at<uchar>(y, x) == 0) continue;
        if (const auto point = rgbd::PointAt(frame, {x, y})) points.push_back(T_camera_mesh->inverse() * *point);
      }
    }
  }
  if (points.empty()) {
    throw std::runtime_error(scene_.folder().string() + ": no frame has depth on object " + std::to_string(object_id_) +
                             "; its true surface is not known");
  }
  return Eigen::Map<const Eigen::Matrix3Xd>(points[0].data(), 3, static_cast<Eigen::Index>(points.size()));
}

model::ObjectModel KnownObject::Learn(const std::vector<int>& ids, const features::FeatureParams& params,
                                      const geometry::Rigid& T_mesh_object) const {
  model::ObjectModel object;
  object.name = kName;
  object.feature_fingerprint = params.Fingerprint();
  for (const int id : ids) {
    const auto T_camera_mesh = TruePose(id);
    cv::Mat mask = Mask(id);
    cv::erode(mask, mask, cv::Mat(), cv::Point(-1, -1), kLabelBorder);
    if (!T_camera_mesh || cv::countNonZero(mask) == 0) continue;
    const rgbd::Frame frame = scene_.Load(id);
    const features::Features features = features::Extract(rgbd::Gray(frame), mask, params);
    auto extended = learning::WithView(object, frame, mask, features, *T_camera_mesh * T_mesh_object, {}, kMinViewPoints);
    if (extended) object = std::move(*extended);
  }
  return object;
}

}  // namespace vantage::cli
