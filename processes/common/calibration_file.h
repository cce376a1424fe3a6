// Calibrations as YAML files: what `vantage calibrate` writes and the sensor reads.
#pragma once

#include <filesystem>
#include <string>

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

}  // namespace vantage::processes
