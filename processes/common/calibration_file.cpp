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

}  // namespace vantage::processes
