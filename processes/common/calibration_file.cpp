#include "common/calibration_file.h"

#include <algorithm>
#include <iomanip>
#include <sstream>

#include "config/yaml.h"

namespace vantage::processes {

CalibrationFile LoadCalibration(const std::filesystem::path& file) {
  CalibrationFile result;
  auto& camera = result.calibration.camera;
  auto yaml = config::Mapping::Load(file);
  yaml.Get("width", camera.width);
  yaml.Get("height", camera.height);
  yaml.Get("fx", camera.fx);
  yaml.Get("fy", camera.fy);
  yaml.Get("cx", camera.cx);
  yaml.Get("cy", camera.cy);
  std::vector<double> distortion(5, 0.0);
  yaml.Get("distortion", distortion);
  if (distortion.size() != 5) {
    yaml.Fail("distortion", "must be 5 numbers k1, k2, p1, p2, k3, are " + std::to_string(distortion.size()));
  }
  std::copy(distortion.begin(), distortion.end(), result.calibration.distortion.begin());
  yaml.Get("rms_px", result.rms_px);
  yaml.Get("images", result.images);
  yaml.Finish();
  yaml.Check(result.calibration);
  return result;
}

std::string ToYaml(const CalibrationFile& file) {
  const auto& camera = file.calibration.camera;
  const auto& k = file.calibration.distortion;
  std::ostringstream text;
  text << std::setprecision(10);
  text << "# A camera's intrinsics (sensor --calibration). Pixels; the centre of the top left pixel is (0, 0).\n"
       << "width: " << camera.width << "\nheight: " << camera.height << "\nfx: " << camera.fx << "\nfy: " << camera.fy
       << "\ncx: " << camera.cx << "\ncy: " << camera.cy << "\n"
       << "distortion: [" << k[0] << ", " << k[1] << ", " << k[2] << ", " << k[3] << ", " << k[4] << "]  # k1, k2, p1, p2, k3\n"
       << "rms_px: " << file.rms_px << "  # Reprojection error...\n"
       << "images: " << file.images << "  # ...over so many images.\n";
  return text.str();
}

Eigen::Vector3d HandEyeFile::RotationVector_rad() const {
  const Eigen::AngleAxisd turn(T_mount_camera.linear());
  return turn.angle() * turn.axis();
}

HandEyeFile LoadHandEye(const std::filesystem::path& file) {
  auto yaml = config::Mapping::Load(file);
  if (!yaml.Has("T_mount_camera")) yaml.Fail("T_mount_camera", "expected as `vantage calibrate --hand-eye` writes it, found none");
  std::vector<double> numbers;
  yaml.Get("T_mount_camera", numbers);
  if (numbers.size() != 16) {
    yaml.Fail("T_mount_camera", "must be 16 numbers, row by row, are " + std::to_string(numbers.size()));
  }
  const Eigen::Matrix4d matrix = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(numbers.data());
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  constexpr double kRounding = 1e-3;  // Of numbers written by hand.
  if (!(rotation * rotation.transpose()).isIdentity(kRounding) || rotation.determinant() < 0.0 ||
      !matrix.row(3).isApprox(Eigen::RowVector4d(0, 0, 0, 1), kRounding)) {
    yaml.Fail("T_mount_camera", "must be a rotation and a translation over a row 0, 0, 0, 1; this is no rigid transform");
  }
  HandEyeFile result;
  result.T_mount_camera.linear() = Eigen::Quaterniond(rotation).normalized().toRotationMatrix();
  result.T_mount_camera.translation() = matrix.topRightCorner<3, 1>();
  const double distance_m = result.T_mount_camera.translation().norm();
  if (distance_m > 10.0) {
    yaml.Fail("T_mount_camera", "expected metres, found a camera " + std::to_string(distance_m) + " m from its mount");
  }
  yaml.Get("rms_px", result.rms_px);
  yaml.Get("views", result.views);
  yaml.Finish();
  return result;
}

std::string ToYaml(const HandEyeFile& file) {
  std::ostringstream text;
  text << std::setprecision(10)
       << "# Where the camera sits on the mount (hand_eye in the library's YAML): row-major, metres; maps camera points into the "
          "mount.\n"
       << "T_mount_camera: [";
  for (int i = 0; i < 16; ++i) text << (i > 0 ? ", " : "") << file.T_mount_camera(i / 4, i % 4);
  text << "]\nrms_px: " << file.rms_px << "  # Reprojection error...\nviews: " << file.views << "  # ...over so many views.\n";
  return text.str();
}

}  // namespace vantage::processes
