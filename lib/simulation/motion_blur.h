// What the camera's own motion does to a picture while the shutter is open.
#pragma once

#include <opencv2/core.hpp>

#include "geometry/camera.h"
#include "geometry/rigid.h"

namespace vantage::simulation {

// How a camera moves at an instant, in its own coordinates: the velocity of its origin, and its turning.
struct Twist {
  Eigen::Vector3d linear_m_s{0, 0, 0};
  Eigen::Vector3d angular_rad_s{0, 0, 0};
};

// The twist that carries a camera from one pose to another in `time_s`, in coordinates of the first.
Twist TwistBetween(const geometry::Rigid& T_world_from, const geometry::Rigid& T_world_to, double time_s);

// How far a point of the still world moves in the image, pixels a second: seen at `pixel`, 1 / z in 1/m (0 = infinitely far).
Eigen::Vector2d ImageMotion(const geometry::PinholeCamera& camera, const Eigen::Vector2d& pixel, double inverse_depth,
                            const Twist& twist);

// Averages every pixel of `color` (CV_8UC3) over its own path while the shutter is open, which is centred on the picture's time.
// `depth` is CV_32FC1, metres, 0 = infinitely far. What comes out from behind an edge is not known and is taken from where the path
// leads. Nothing is done where the path is shorter than a quarter of a pixel. About 15 ms for 640 x 480 and 2 px.
void BlurByMotion(const cv::Mat& depth, const geometry::PinholeCamera& camera, const Twist& twist, double exposure_s,
                  cv::Mat* color);

}  // namespace vantage::simulation
