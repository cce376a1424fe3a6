// Calibration boards: checkerboards and sheets of AprilTag or ArUco markers, found in images.
#pragma once

#include <Eigen/Core>
#include <array>
#include <map>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace vantage::calibration {

// What is printed. The board's frame: metres; of a checkerboard or grid x right, y down, z into the paper, the origin at the first
// inner corner, or the first tag's top left corner.
struct Board {
  enum class Kind { kCheckerboard, kTags };
  Kind kind = Kind::kCheckerboard;
  int columns = 9;  // Of inner corners; not a square with the rows, else which is which cannot be told. >= 3.
  int rows = 6;     // >= 3.
  double square_m = 0.025;
  std::string dictionary = "36h11";                    // Of the tags: 36h11, 25h9, 16h5, or an ArUco one, "4x4_50" to "7x7_1000".
  std::map<int, std::array<Eigen::Vector3d, 4>> tags;  // Corners of every tag, as printed clockwise from its top left one.

  void Check() const;   // Throws std::invalid_argument naming the field.
  bool planar() const;  // All corners in the plane z = 0.
};

// A grid of tags with ascending ids, row by row.
Board TagGrid(const std::string& dictionary, int columns, int rows, double tag_m, double gap_m, int first_id);

// The board in one image: board points and where they are seen.
struct BoardView {
  std::vector<Eigen::Vector3d> points_m;  // Board frame.
  std::vector<Eigen::Vector2d> pixels;    // Distorted, as in the image.
  std::vector<int> parts;                 // The tag a point belongs to; 0 on checkerboards.
  bool empty() const { return points_m.empty(); }
};

// Finds the board, to a fraction of a pixel. Empty where it is not seen: a checkerboard whole, of tags one at least. `gray`:
// CV_8UC1. Throws as Board::Check does. About 20 ms (tags) for 1280 x 720.
BoardView FindBoard(const cv::Mat& gray, const Board& board);

}  // namespace vantage::calibration
