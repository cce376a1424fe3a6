// A camera's intrinsics and distortion from views of a board.
#pragma once

#include <string>
#include <vector>

#include "calibration/board.h"
#include "geometry/rigid.h"
#include "rgbd/calibration.h"

namespace vantage::calibration {

struct IntrinsicsParams {
  int distortion_terms = 4;  // 0: none, 2: k1 and k2, 4: p1 and p2 as well, 5: k3 as well.
  int min_points = 12;       // A view with fewer does not count.
  double max_ratio = 3.0;    // A view with an error so many times the median's is left out; > 1.

  void Check() const;  // Throws std::invalid_argument naming the field.
};

struct IntrinsicsResult {
  rgbd::CameraCalibration calibration;
  double rms_px = 0.0;                          // Over all points of the views used.
  double focal_sigma_px = 0.0;                  // Standard deviation of fx...
  double centre_sigma_px = 0.0;                 // ...and of the worse of cx and cy.
  std::vector<int> used;                        // Indices of the views that count, ascending.
  std::vector<double> view_rms_px;              // Of these...
  std::vector<geometry::Rigid> T_camera_board;  // ...likewise.
  double coverage = 0.0;                        // Share of the image's 8 x 6 cells that points were seen in.
  double max_tilt_deg = 0.0;                    // Of the board against the image plane.
  std::vector<std::string> warnings;            // What makes the result doubtful, and what to do; for people.
};

// Zhang's method (2000), then non-linear over all. The board must be planar. Throws std::runtime_error saying what is missing with
// fewer than 3 usable views.
IntrinsicsResult CalibrateIntrinsics(const std::vector<BoardView>& views, cv::Size image_size, const IntrinsicsParams& params = {});

// Where in the image points were seen, cells without any darker, and every point's error drawn 20 times as long. CV_8UC3.
cv::Mat DrawCoverage(const std::vector<BoardView>& views, const IntrinsicsResult& result);

}  // namespace vantage::calibration
