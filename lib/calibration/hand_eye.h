// Where the camera sits on the mount that carries it, from views of a board that stands still.
#pragma once

#include <string>
#include <vector>

#include "calibration/board.h"
#include "geometry/rigid.h"
#include "rgbd/calibration.h"

namespace vantage::calibration {

struct HandEyeView {
  geometry::Rigid T_world_mount = geometry::Rigid::Identity();  // What the mount says, when the image was taken.
  BoardView board;
};

struct HandEyeParams {
  double mount_sigma_m = 0.001;  // How well the mount knows where it is; > 0...
  double mount_sigma_deg = 0.1;  // ...and how it is turned; > 0.
  double pixel_sigma = 0.3;      // How well corners are found; > 0.

  void Check() const;  // Throws std::invalid_argument naming the field.
};

struct HandEyeResult {
  geometry::Rigid T_mount_camera = geometry::Rigid::Identity();
  geometry::Rigid T_world_board = geometry::Rigid::Identity();
  double rms_px = 0.0;                // Over all points of the views used, with the mount where it says it is.
  double position_mm = 0.0;           // Rms of how far views disagree on where the board is...
  double rotation_deg = 0.0;          // ...and how it is turned: what the mount's own errors amount to.
  double turn_deg = 0.0;              // How far the mount turned about the axis it turned least about (of the two most used).
  int views = 0;                      // Used.
  std::vector<std::string> warnings;  // What makes the result doubtful, and what to do; for people.
};

// Park and Martin (1994), then all at once: T_mount_camera, T_world_board and the mount's own error in every view, the likeliest
// under `params`. (Reprojection error alone blames the mount's errors on the camera: 8 mm off where the mount erred by 2.) Throws
// std::runtime_error saying what is missing: fewer than 3 usable views, a mount that never turned about two different axes.
HandEyeResult CalibrateHandEye(const std::vector<HandEyeView>& views, const rgbd::CameraCalibration& calibration,
                               const HandEyeParams& params = {});

}  // namespace vantage::calibration
