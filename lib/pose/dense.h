// Refinement of one camera pose on all that a frame shows of an object: its surface against the depth image, its texture against
// the colour image. Interest points say where the object is; this says it better, above all where there are few of them.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "pose/refine.h"
#include "rgbd/frame.h"

namespace vantage::pose {

// A point of the object's surface; object frame, metres, unit normal outward.
struct SurfacePoint {
  Eigen::Vector3d point;
  Eigen::Vector3d normal;
};

// A point of the surface where brightness changes, and how bright a view saw it there.
struct TexturePoint {
  Eigen::Vector3d point;
  Eigen::Vector3d normal;
  double brightness = 0.0;  // Of the smoothed image, grey levels.
};

// Least cosine between normal and ray at which texture is read or compared: what is seen more slantwise is smeared, and near a
// round outline smoothing moves it.
constexpr double kMinTextureCosine = 0.6;

// The grey image that texture is read from and compared in: smoothed, so that it changes slowly from pixel to pixel.
class SmoothImage {
 public:
  // Of the part of the frame in `area` (clipped to the image).
  SmoothImage(const rgbd::Frame& frame, const cv::Rect& area);

  struct Sample {
    double brightness = 0.0;
    Eigen::Vector2d gradient;  // Grey levels per pixel.
  };
  // Bilinear; nullopt outside the area and near its border.
  std::optional<Sample> At(const Eigen::Vector2d& pixel) const;

 private:
  cv::Mat_<float> grey_;
  cv::Point corner_;
};

// What is known of an object's looks from a few views.
struct Appearance {
  std::vector<SurfacePoint> surface;
  std::vector<std::vector<TexturePoint>> textures;  // One per view: each has a brightness and a contrast of its own.
};

struct DenseParams {
  double independent_matches = 50.0;  // Points were lifted from few depth images, and what they look like changes with the view:
                                      // they err together. All matches count as so many at most; > 0.
  double min_texture_sigma = 2.0;     // Differences in brightness, grey levels, are taken to scatter at least so much; > 0.

  void Check() const;  // Throws std::invalid_argument naming the field.
};

// As RefinePose; besides, the surface is drawn to the frame's depth image (point to plane, projective association; samples further
// than 2 cm from it do not count), the texture to its colour image (difference in brightness, the view's mean and contrast made
// the frame's), the pose to the prior. The start must be within a centimetre, and texture within some two pixels. `image`: null
// where texture is not to be used. Cost: about 1 ms for 1000 samples of each.
geometry::Rigid RefinePoseDensely(const std::vector<Match2d3d>& matches, const std::vector<int>& index,
                                  const Appearance& appearance, const rgbd::Frame& frame, const SmoothImage* image,
                                  const std::optional<PosePrior>& prior, const geometry::Rigid& T_camera_object, double scale_px,
                                  const DenseParams& params, int iterations = 30);

// What surface and texture alone say about a pose.
struct DenseFit {
  geometry::Rigid T_camera_object = geometry::Rigid::Identity();
  Eigen::Matrix<double, 6, 6> information;  // Of the step (translation, rotation vector) in camera coordinates; may be singular.
  int samples = 0;                          // Of the surface that were measured near enough.
  int texture_samples = 0;
  std::optional<double> likeness;  // Correlation of the brightness that was expected with what is seen, of the view that looks most
                                   // alike; nullopt where none shows enough texture.
  std::optional<double> agreement;  // Share of the surface that should be seen, and has depth there, that is measured in its place;
                                    // nullopt where there is little of it.
};

// The pose that draws surface and texture to the frame (as above, but nothing else speaks). Where the object could slide along
// itself the pose stays; the information says which way. Cost: about 0.2 ms for 300 samples.
DenseFit FitDensely(const Appearance& appearance, const rgbd::Frame& frame, const SmoothImage* image,
                    const geometry::Rigid& T_camera_object, const DenseParams& params, int iterations = 30);

}  // namespace vantage::pose
