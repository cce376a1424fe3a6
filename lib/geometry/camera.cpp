#include "geometry/camera.h"

#include <cmath>
#include <stdexcept>
#include <string>

namespace vantage::geometry {
namespace {

void Require(bool ok, const char* what, double found) {
  if (!ok) throw std::invalid_argument(std::string("camera: ") + what + ", is " + std::to_string(found));
}

}  // namespace

void PinholeCamera::Check() const {
  Require(width > 0, "width must be > 0 px", width);
  Require(height > 0, "height must be > 0 px", height);
  Require(std::isfinite(fx) && fx > 0.0, "fx must be > 0 px", fx);
  Require(std::isfinite(fy) && fy > 0.0, "fy must be > 0 px", fy);
  Require(std::isfinite(cx), "cx must be finite", cx);
  Require(std::isfinite(cy), "cy must be finite", cy);
}

std::optional<Eigen::Vector2d> PinholeCamera::Project(const Eigen::Vector3d& p) const {
  if (!(p.z() > 1e-3)) return std::nullopt;
  return Eigen::Vector2d(fx * p.x() / p.z() + cx, fy * p.y() / p.z() + cy);
}

Eigen::Vector3d PinholeCamera::Unproject(const Eigen::Vector2d& pixel, double depth_m) const {
  return {(pixel.x() - cx) / fx * depth_m, (pixel.y() - cy) / fy * depth_m, depth_m};
}

bool PinholeCamera::Contains(const Eigen::Vector2d& pixel, double margin_px) const {
  return pixel.x() >= margin_px && pixel.y() >= margin_px && pixel.x() <= width - 1 - margin_px &&
         pixel.y() <= height - 1 - margin_px;
}

PinholeCamera PinholeCamera::Cropped(int x, int y, int crop_width, int crop_height) const {
  return {crop_width, crop_height, fx, fy, cx - x, cy - y};
}

PinholeCamera PinholeCamera::Scaled(double factor) const {
  return {static_cast<int>(std::lround(width * factor)),
          static_cast<int>(std::lround(height * factor)),
          fx * factor,
          fy * factor,
          (cx + 0.5) * factor - 0.5,
          (cy + 0.5) * factor - 0.5};
}

bool PinholeCamera::operator==(const PinholeCamera& other) const {
  return width == other.width && height == other.height && fx == other.fx && fy == other.fy && cx == other.cx && cy == other.cy;
}

}  // namespace vantage::geometry
