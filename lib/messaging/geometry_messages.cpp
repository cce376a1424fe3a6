#include "messaging/geometry_messages.h"

#include <cmath>

namespace vantage::messaging {
namespace {

constexpr double kMaxPosition_m = 1000.0;
constexpr int kMaxImageSize_px = 8192;

}  // namespace

bool AllFinite(const double* values, int count) {
  for (int i = 0; i < count; ++i) {
    if (!std::isfinite(values[i])) return false;
  }
  return true;
}

bool IsProbability(double value) { return value >= 0.0 && value <= 1.0; }

pose_t ToMessage(const geometry::Rigid& T_a_b) {
  pose_t message;
  Eigen::Quaterniond q(T_a_b.linear());
  q.normalize();
  for (int i = 0; i < 3; ++i) message.position[i] = T_a_b.translation()[i];
  message.orientation[0] = q.w();
  message.orientation[1] = q.x();
  message.orientation[2] = q.y();
  message.orientation[3] = q.z();
  return message;
}

Result<geometry::Rigid> FromMessage(const pose_t& message) {
  using Pose = Result<geometry::Rigid>;
  if (!AllFinite(message.position, 3) || !AllFinite(message.orientation, 4)) return Pose::Error("a pose that is not finite");
  const Eigen::Vector3d position(message.position[0], message.position[1], message.position[2]);
  if (position.cwiseAbs().maxCoeff() > kMaxPosition_m) return Pose::Error("a position more than 1 km away");
  const Eigen::Quaterniond q(message.orientation[0], message.orientation[1], message.orientation[2], message.orientation[3]);
  if (std::abs(q.norm() - 1.0) > 0.01) return Pose::Error("an orientation that is no unit quaternion");
  geometry::Rigid T_a_b = geometry::Rigid::Identity();
  T_a_b.linear() = q.normalized().toRotationMatrix();
  T_a_b.translation() = position;
  return T_a_b;
}

camera_t ToMessage(const geometry::PinholeCamera& camera) {
  camera_t message;
  message.width = camera.width;
  message.height = camera.height;
  message.fx = camera.fx;
  message.fy = camera.fy;
  message.cx = camera.cx;
  message.cy = camera.cy;
  return message;
}

Result<geometry::PinholeCamera> FromMessage(const camera_t& message) {
  using Camera = Result<geometry::PinholeCamera>;
  if (message.width < 1 || message.width > kMaxImageSize_px || message.height < 1 || message.height > kMaxImageSize_px) {
    return Camera::Error("an image of " + std::to_string(message.width) + " x " + std::to_string(message.height) + " pixels");
  }
  const double values[] = {message.fx, message.fy, message.cx, message.cy};
  if (!AllFinite(values, 4) || message.fx <= 0.0 || message.fy <= 0.0) return Camera::Error("camera intrinsics out of range");
  geometry::PinholeCamera camera;
  camera.width = message.width;
  camera.height = message.height;
  camera.fx = message.fx;
  camera.fy = message.fy;
  camera.cx = message.cx;
  camera.cy = message.cy;
  return camera;
}

}  // namespace vantage::messaging
