#include "learning/motion.h"

#include <algorithm>

namespace vantage::learning {
namespace {

constexpr double kMaxGap_s = 0.25;  // After a longer gap between frames the last motion says nothing about where the object is.

double Seconds(std::int64_t from_us, std::int64_t to_us) { return 1e-6 * static_cast<double>(to_us - from_us); }

}  // namespace

double LargestShift(const model::ObjectModel& object, const geometry::PinholeCamera& camera,
                    const geometry::Rigid& T_camera_object_a, const geometry::Rigid& T_camera_object_b) {
  double largest = 0.0;
  for (const model::ModelPoint& point : object.points) {
    const auto a = camera.Project(T_camera_object_a * point.position);
    const auto b = camera.Project(T_camera_object_b * point.position);
    if (a && b) largest = std::max(largest, (*a - *b).norm());
  }
  return largest;
}

geometry::Rigid Continued(const geometry::Rigid& before, const geometry::Rigid& last, double last_interval_s, double ahead_s) {
  if (!(last_interval_s > 0.0) || !(ahead_s > 0.0)) return last;
  const double share = std::min(3.0, ahead_s / last_interval_s);
  const geometry::Rigid motion = before.inverse() * last;  // In the object's frame: small, whatever the distance.
  const Eigen::AngleAxisd turn(motion.linear());
  geometry::Rigid step = geometry::Rigid::Identity();
  step.linear() = Eigen::AngleAxisd(share * turn.angle(), turn.axis()).toRotationMatrix();
  step.translation() = share * motion.translation();
  return last * step;
}

std::optional<geometry::Rigid> Motion::Predicted(std::int64_t utime) const {
  if (!last_) return std::nullopt;
  if (!IsSteady(utime)) return last_->T_camera_object;
  return Continued(before_->T_camera_object, last_->T_camera_object, Seconds(before_->utime, last_->utime),
                   Seconds(last_->utime, utime));
}

bool Motion::IsSteady(std::int64_t utime) const { return before_ && Seconds(last_->utime, utime) <= kMaxGap_s; }

void Motion::Found(const model::ObjectModel& object, const geometry::PinholeCamera& camera, const geometry::Rigid& T_camera_object,
                   std::int64_t utime) {
  const auto predicted = Predicted(utime);
  const bool has_gap = !last_ || Seconds(last_->utime, utime) > kMaxGap_s;
  before_ = has_gap ? std::nullopt : last_;
  error_px_ = has_gap ? 0.0 : LargestShift(object, camera, *predicted, T_camera_object);
  last_ = Place{T_camera_object, utime};
}

void Motion::ChangeObject(const geometry::Rigid& T_before_after) {
  if (last_) last_->T_camera_object = last_->T_camera_object * T_before_after;
  if (before_) before_->T_camera_object = before_->T_camera_object * T_before_after;
}

}  // namespace vantage::learning
