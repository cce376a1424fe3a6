// Judging a learned model against the truth: on views that were not used for learning, by the real recogniser.
#pragma once

#include <memory>
#include <vector>

#include "assessment/assessor.h"
#include "recognition/recogniser.h"
#include "simulation/recorded_world.h"
#include "simulation/simulated_world.h"

namespace vantage::session {

struct JudgeView {
  rgbd::Frame frame;
  features::Features features;                                  // Computed once.
  geometry::Rigid T_camera_mesh = geometry::Rigid::Identity();  // The truth.
};

class Judge {
 public:
  // `points_in_mesh`: the true object's surface, 3 x N, metres. `recogniser`: as used in the field, at most without query depth.
  Judge(const recognition::RecogniserParams& recogniser, Eigen::Matrix3Xd points_in_mesh);

  // Takes a view on where at least half of the object's points lie in the image; returns whether it did. Features are computed
  // here.
  bool Add(const rgbd::Frame& frame, const geometry::Rigid& T_camera_mesh);
  int size() const { return static_cast<int>(views_.size()); }
  const std::vector<JudgeView>& views() const { return views_; }
  const Eigen::Matrix3Xd& points_in_mesh() const { return points_in_mesh_; }

  // Share of the views in which the object is detected (p(o|c) >= 1/2) within 4 cm of the truth. `T_mesh_object` places the model's
  // frame.
  double TrueDetectionRate(std::shared_ptr<const model::ObjectModel> object, const geometry::Rigid& T_mesh_object) const;
  // The same view by view: != 0 where it is detected. Views with 0 in `asked` (same order, or empty: all are) are not looked at.
  std::vector<char> Outcomes(std::shared_ptr<const model::ObjectModel> object, const geometry::Rigid& T_mesh_object,
                             const std::vector<char>& asked = {}) const;
  // Which views see the object from less than `max_angle_rad` off a direction (object coordinates, unit): != 0.
  std::vector<char> Near(const Eigen::Vector3d& direction, const geometry::Rigid& T_mesh_object, double max_angle_rad) const;

 private:
  bool IsDetected(const recognition::Recogniser& recogniser, const JudgeView& view, const geometry::Rigid& T_mesh_object) const;

  recognition::RecogniserParams recogniser_params_;
  Eigen::Matrix3Xd points_in_mesh_;
  std::vector<JudgeView> views_;
};

// Share of the points that project into the image.
double ShareInImage(const Eigen::Matrix3Xd& points, const geometry::Rigid& T_camera_points, const geometry::PinholeCamera& camera);

}  // namespace vantage::session
