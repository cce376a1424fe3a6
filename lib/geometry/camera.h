// The pinhole camera: pixels, metres, no distortion (a source undistorts before it hands out frames).
#pragma once

#include <Eigen/Core>
#include <optional>

namespace vantage::geometry {

struct PinholeCamera {
  int width = 0;    // Pixels; > 0.
  int height = 0;   // Pixels; > 0.
  double fx = 0.0;  // Pixels; > 0.
  double fy = 0.0;  // Pixels; > 0.
  double cx = 0.0;  // Pixels; the centre of the top left pixel is (0, 0).
  double cy = 0.0;

  void Check() const;  // Throws std::invalid_argument naming the first field out of range.

  // The pixel of a point in camera coordinates, metres; nullopt where it is not in front of the camera (z <= 1 mm). It may lie
  // outside the image: ask Contains.
  std::optional<Eigen::Vector2d> Project(const Eigen::Vector3d& point_in_camera) const;

  // The point at `depth_m` (along z) on the ray through a pixel; camera coordinates, metres.
  Eigen::Vector3d Unproject(const Eigen::Vector2d& pixel, double depth_m) const;

  // Whether the pixel lies in the image, at least `margin_px` from its border.
  bool Contains(const Eigen::Vector2d& pixel, double margin_px = 0.0) const;

  // The camera of the sub-image whose top left pixel is (x, y).
  PinholeCamera Cropped(int x, int y, int crop_width, int crop_height) const;

  // The camera of the image resized by `factor`.
  PinholeCamera Scaled(double factor) const;

  bool operator==(const PinholeCamera& other) const;
};

}  // namespace vantage::geometry
