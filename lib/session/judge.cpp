#include "session/judge.h"

#include <numeric>
#include <opencv2/core/utility.hpp>

#include "geometry/rigid.h"

namespace vantage::session {
namespace {

constexpr double kCorrect = 0.04;  // Metres of mean point distance (section V-A of the paper).
constexpr double kDetected = 0.5;  // p(o|c) from which a detection counts as one.
constexpr double kMinShareInImage = 0.5;

}  // namespace

double ShareInImage(const Eigen::Matrix3Xd& points, const geometry::Rigid& T_camera_points, const geometry::PinholeCamera& camera) {
  if (points.cols() == 0) return 0.0;
  int inside = 0;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const auto pixel = camera.Project(T_camera_points * Eigen::Vector3d(points.col(i)));
    inside += pixel && camera.Contains(*pixel);
  }
  return double(inside) / points.cols();
}

Judge::Judge(const recognition::RecogniserParams& recogniser, Eigen::Matrix3Xd points_in_mesh)
    : recogniser_params_(recogniser), points_in_mesh_(std::move(points_in_mesh)) {}

bool Judge::Add(const rgbd::Frame& frame, const geometry::Rigid& T_camera_mesh) {
  if (ShareInImage(points_in_mesh_, T_camera_mesh, frame.camera) < kMinShareInImage) return false;
  const recognition::Recogniser recogniser(recogniser_params_);
  views_.push_back({frame, recogniser.Extract(frame), T_camera_mesh});
  return true;
}

double Judge::TrueDetectionRate(std::shared_ptr<const model::ObjectModel> object, const geometry::Rigid& T_mesh_object) const {
  if (views_.empty()) return 0.0;
  const std::vector<char> right = Outcomes(std::move(object), T_mesh_object);
  return std::accumulate(right.begin(), right.end(), 0.0) / size();
}

std::vector<char> Judge::Outcomes(std::shared_ptr<const model::ObjectModel> object, const geometry::Rigid& T_mesh_object,
                                  const std::vector<char>& asked) const {
  recognition::Recogniser recogniser(recogniser_params_);
  recogniser.Set(object);
  std::vector<char> right(views_.size(), 0);
  cv::parallel_for_(cv::Range(0, size()), [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i) {
      if (asked.empty() || asked[i] != 0) right[i] = IsDetected(recogniser, views_[i], T_mesh_object);
    }
  });
  return right;
}

std::vector<char> Judge::Near(const Eigen::Vector3d& direction, const geometry::Rigid& T_mesh_object, double max_angle_rad) const {
  std::vector<char> near;
  for (const JudgeView& view : views_) {
    const Eigen::Vector3d camera_in_object = (view.T_camera_mesh * T_mesh_object).inverse().translation();
    near.push_back(static_cast<char>(geometry::AngleBetween(camera_in_object, direction) < max_angle_rad));
  }
  return near;
}

bool Judge::IsDetected(const recognition::Recogniser& recogniser, const JudgeView& view,
                       const geometry::Rigid& T_mesh_object) const {
  for (const recognition::Detection& detection : recogniser.Recognise(view.frame, view.features)) {
    if (detection.probability < kDetected) continue;
    const geometry::Rigid T_camera_mesh = detection.T_camera_object * T_mesh_object.inverse();
    return model::MeanPointDistance(points_in_mesh_, T_camera_mesh, view.T_camera_mesh) < kCorrect;
  }
  return false;
}

}  // namespace vantage::session
