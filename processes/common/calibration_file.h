// Calibrations as YAML files: what `vantage calibrate` writes, the sensor (the lens) and whoever has a mount (hand-eye) read.
#pragma once

#include <filesystem>
#include <string>

#include "geometry/rigid.h"
#include "rgbd/calibration.h"

namespace vantage::processes {

// A calibration and how good it is.
struct CalibrationFile {
  rgbd::CameraCalibration calibration;
  double rms_px = 0.0;  // Reprojection error it was made with; 0: unknown.
  int images = 0;       // That it was made from; 0: unknown.
};

// Keys: width, height, fx, fy, cx, cy (pixels), distortion [k1, k2, p1, p2, k3], rms_px, images. Throws std::runtime_error
// "FILE:LINE: ...": missing, broken, an unknown key, a value out of range.
CalibrationFile LoadCalibration(const std::filesystem::path& file);

std::string ToYaml(const CalibrationFile& calibration);

// Where a camera sits on its mount and how well that is known.
struct HandEyeFile {
  geometry::Rigid T_mount_camera = geometry::Rigid::Identity();
  double rms_px = 0.0;  // Reprojection error it was found with; 0: unknown.
  int views = 0;        // That it was found from; 0: unknown.

  Eigen::Vector3d RotationVector_rad() const;  // How the camera is turned: axis times angle, in the mount's axes.
};

// Keys: T_mount_camera (16 numbers, row-major, metres), rms_px, views. The rotation is made exact. Throws std::runtime_error
// "FILE:LINE: ...": missing, broken, an unknown key, no rigid transform, farther than 10 m (millimetres?).
HandEyeFile LoadHandEye(const std::filesystem::path& file);

std::string ToYaml(const HandEyeFile& hand_eye);

}  // namespace vantage::processes
