// Detection confidence (1), (2): one function for learner, recogniser and training.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "model/object_model.h"

namespace vantage::model {

struct ConfidenceParams {
  double support_px = 2.0;          // t_int: an interest point this near supports a projected model point...; > 0.
  double max_scale_ratio = 1.5;     // ...where its size differs from the expected by less than this factor; > 1.
  double max_incidence_deg = 80.0;  // A point is visible where line of sight and normal differ by less; (0, 90].
  double occlusion_m = 0.03;        // Measured depth this much in front of a point hides it (where there is depth); > 0.
  int min_points = 8;               // A view with fewer visible model points says nothing: c_ij = 0; >= 1.
  int max_views = 6;                // Only so many views, nearest in direction to the pose, are tried; >= 1.

  void Check() const;
  std::string Fingerprint() const;
};

// Fast lookup "is there an interest point near this pixel": a grid over the image.
class KeypointGrid {
 public:
  KeypointGrid(const std::vector<cv::KeyPoint>& keypoints, int width, int height, double cell_px = 8.0);

  // Whether there is one within the radius whose size is within a factor `max_scale_ratio` of `size`.
  bool HasNear(const Eigen::Vector2d& pixel, double radius_px, double size, double max_scale_ratio) const;
  // Indices of the keypoints within the radius.
  std::vector<int> Near(const Eigen::Vector2d& pixel, double radius_px) const;

 private:
  std::vector<cv::Point2f> points_;
  std::vector<float> sizes_;
  std::vector<std::vector<int>> cells_;
  int columns_;
  int rows_;
  double cell_px_;
};

struct Confidence {
  double value = 0.0;  // c_i, [0, 1].
  int view = -1;       // Index of the view j that gives the maximum; -1 where none has enough visible points.
  int support = 0;     // n_support,ij.
  int visible = 0;     // n_model,ij: points that face the camera and are not hidden; also those outside the image, where nothing
                       // can speak for the pose: an object that is mostly cut off is not detected surely.
};

// c_ij of one view. `frame` gives camera and, where present, depth.
Confidence ViewConfidence(const ObjectModel& model, int view, const geometry::Rigid& T_camera_object, const rgbd::Frame& frame,
                          const KeypointGrid& keypoints, const ConfidenceParams& params);

// Indices of the `count` views whose directions are nearest to the pose's, nearest first.
std::vector<int> NearestViews(const ObjectModel& model, const geometry::Rigid& T_camera_object, int count);

// c_i = max_j c_ij over the views nearest in direction.
Confidence ObjectConfidence(const ObjectModel& model, const geometry::Rigid& T_camera_object, const rgbd::Frame& frame,
                            const KeypointGrid& keypoints, const ConfidenceParams& params);

}  // namespace vantage::model
