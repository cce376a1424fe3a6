// What a partial model looks like from elsewhere: its keyframes as textured depth meshes, ray-cast at poses never seen.
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "model/object_model.h"

namespace vantage::assessment {

// Where a virtual camera stands relative to a learned view.
struct VirtualPose {
  double rotation_rad = 0.0;  // Out of plane, about the object's origin, [0, pi/2).
  double tilt_rad = 0.0;      // Direction of the tilt axis in the image plane.
  double roll_rad = 0.0;      // In plane.
  double log2_scale = 0.0;    // log2(learned distance / virtual distance).
};

// T_camera_object of the virtual camera. It looks straight at the object's origin.
geometry::Rigid VirtualCameraPose(const model::View& view, const VirtualPose& pose);

struct VirtualImage {
  cv::Mat color;    // CV_8UC3 BGR; black where `mask` is 0.
  cv::Mat mask;     // CV_8UC1, 255 where the object's known surface is seen.
  cv::Mat normals;  // CV_32FC3, outward, object coordinates, smoothed, about unit length; zero where unknown. For Relight().
};

// What falls on an object: light from everywhere and from one lamp.
struct Light {
  double ambient = 1.0;                                // Share of the light that comes from everywhere, [0, 1].
  Eigen::Vector3d to_lamp = Eigen::Vector3d::UnitZ();  // Unit, object coordinates.
};

// The known surface of an object. Built once per model; rendering is const.
class VirtualObject {
 public:
  // Meshes of all keyframes with depth. Cost: some 10 ms and 5 MB a view. The model must outlive this.
  explicit VirtualObject(const model::ObjectModel& object);
  ~VirtualObject();

  // A camera with the focal length of view `view` that sees the known object at this pose plus a margin, never larger than
  // max_width x max_height. Where the object is not in front of the camera, the largest window.
  geometry::PinholeCamera Window(int view, const geometry::Rigid& T_camera_object, int max_width, int max_height) const;

  // The known surface (with small gaps in it closed) as the keyframe nearest in direction to the camera saw it; what that one did
  // not see is filled in from the next ones. So a view is tried on photographs that are not its own wherever there are others.
  // Where nothing is known there is a hole. Surfaces seen from behind are not shown. Cost: 10 ms per keyframe used (at most 4) for
  // 320 x 320.
  VirtualImage Render(const geometry::PinholeCamera& camera, const geometry::Rigid& T_camera_object) const;

 private:
  struct Surface;
  const model::ObjectModel& object_;
  std::vector<std::unique_ptr<Surface>> surfaces_;  // One per view; null where a keyframe has no depth on the object.
  Eigen::Matrix3Xd outline_;                        // Some points of all surfaces, object coordinates, metres.
};

// What an image suffers on its way from the scene.
struct Disturbance {
  double brightness = 1.0;   // Factor; > 0.
  double gamma = 1.0;        // > 0.
  double blur_px = 0.0;      // Sigma; >= 0.
  double image_noise = 0.0;  // Sigma, grey levels; >= 0.
};

// A keyframe's colours hold the light they were taken in. This is what is seen when it changes, the surface being matt: a pixel of
// normal n changes by the ratio of what falls on it, a + (1 - a) max(0, n . l) with ambient share a and lamp l; where n is unknown
// it stays. In place.
void Relight(const Light& before, const Light& after, VirtualImage* image);

// The object over the background (at least as large; its top left part is used), its outline softened as a lens would.
cv::Mat Paste(const VirtualImage& object, const cv::Mat& background);

// Brightness and gamma, then blur, then noise. CV_8UC3 in place.
void Disturb(const Disturbance& disturbance, std::uint32_t seed, cv::Mat* image);

// A frame's image with the object gone, as a background for trials: the masked part (CV_8UC1, non-zero = object) is covered by
// another part of the same image, so that no trace of the object is left.
cv::Mat WithoutObject(const cv::Mat& color, const cv::Mat& mask);

}  // namespace vantage::assessment
