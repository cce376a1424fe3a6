// Where a camera is before a board.
#pragma once

#include <optional>

#include "calibration/board.h"
#include "geometry/rigid.h"
#include "rgbd/calibration.h"

namespace vantage::calibration {

struct BoardPose {
  geometry::Rigid T_camera_board = geometry::Rigid::Identity();
  double rms_px = 0.0;  // Reprojection error of the points used.
  int points = 0;       // Used; those of tags that contradict the others are not.
  int dropped = 0;
};

// The pose with the least reprojection error: started by IPPE (Collins and Bartoli, 2014) on a plane, both of whose two solutions
// are tried, else by SQPnP (Terzakis and Lourakis, 2020), then Levenberg-Marquardt; parts (tags) with a point more than max(3 px, 4
// medians) off are left out, and it is done again. nullopt with fewer than 4 points, or where no solution is in front of the
// camera.
std::optional<BoardPose> EstimateBoardPose(const BoardView& view, const rgbd::CameraCalibration& calibration);

// Where the calibrated camera sees a point, distorted; camera coordinates.
Eigen::Vector2d ProjectDistorted(const rgbd::CameraCalibration& calibration, const Eigen::Vector3d& point_in_camera);

}  // namespace vantage::calibration
