// Where the last frames say the object is: a steady motion, continued.
#pragma once

#include <cstdint>
#include <optional>

#include "model/object_model.h"

namespace vantage::learning {

// The largest distance, in pixels, by which any of the object's points moves between the two poses; 0 where none is in front of
// the camera.
double LargestShift(const model::ObjectModel& object, const geometry::PinholeCamera& camera,
                    const geometry::Rigid& T_camera_object_a, const geometry::Rigid& T_camera_object_b);

// Where a steady motion leads: `before` and `last` are T_camera_object `last_interval_s` apart; the result is `ahead_s` after
// `last`. No more than three intervals ahead.
geometry::Rigid Continued(const geometry::Rigid& before, const geometry::Rigid& last, double last_interval_s, double ahead_s);

// Of the frames the object was found in without a gap since.
class Motion {
 public:
  // T_camera_object at a time; nullopt where the object was not seen of late. Without a motion, or after a gap: where it was.
  std::optional<geometry::Rigid> Predicted(std::int64_t utime) const;
  std::optional<geometry::Rigid> last() const {  // Where it was found last.
    return last_ ? std::optional<geometry::Rigid>(last_->T_camera_object) : std::nullopt;
  }
  // Whether a motion, not only a place, leads there.
  bool IsSteady(std::int64_t utime) const;
  double error_px() const { return error_px_; }  // How far the last prediction was off; 0 where there was none.

  void Found(const model::ObjectModel& object, const geometry::PinholeCamera& camera, const geometry::Rigid& T_camera_object,
             std::int64_t utime);
  void Lost() { *this = {}; }
  // Object coordinates have changed; the object stays where it is in the image.
  void ChangeObject(const geometry::Rigid& T_before_after);

 private:
  struct Place {
    geometry::Rigid T_camera_object;
    std::int64_t utime = 0;
  };
  std::optional<Place> last_;
  std::optional<Place> before_;
  double error_px_ = 0.0;
};

}  // namespace vantage::learning
