#include "calibration/board.h"

#include <algorithm>
#include <cmath>
#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace vantage::calibration {
namespace {

const std::map<std::string, int>& Dictionaries() {
  static const std::map<std::string, int> dictionaries = {
      {"16h5", cv::aruco::DICT_APRILTAG_16h5},   {"25h9", cv::aruco::DICT_APRILTAG_25h9}, {"36h10", cv::aruco::DICT_APRILTAG_36h10},
      {"36h11", cv::aruco::DICT_APRILTAG_36h11}, {"4x4_50", cv::aruco::DICT_4X4_50},      {"4x4_250", cv::aruco::DICT_4X4_250},
      {"5x5_50", cv::aruco::DICT_5X5_50},        {"5x5_250", cv::aruco::DICT_5X5_250},    {"6x6_50", cv::aruco::DICT_6X6_50},
      {"6x6_250", cv::aruco::DICT_6X6_250},      {"7x7_50", cv::aruco::DICT_7X7_50},      {"7x7_1000", cv::aruco::DICT_7X7_1000}};
  return dictionaries;
}

// How far around a tag's corner is looked when it is refined: not as far as the pattern within, an eighth of the side away.
int RefineRadius(const std::vector<cv::Point2f>& corners) {
  double nearest = 1e9;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    nearest = std::min(nearest, cv::norm(corners[i] - corners[(i + 1) % corners.size()]));
  }
  return std::clamp(static_cast<int>(nearest / 9.0), 2, 7);
}

void Refine(const cv::Mat& gray, std::vector<cv::Point2f>& corners, int radius) {
  cv::cornerSubPix(gray, corners, {radius, radius}, {-1, -1}, {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 40, 1e-3});
}

BoardView FindCheckerboard(const cv::Mat& gray, const Board& board) {
  BoardView view;
  std::vector<cv::Point2f> corners;
  const int flags = cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FAST_CHECK;
  if (!cv::findChessboardCorners(gray, {board.columns, board.rows}, corners, flags)) return view;
  double nearest = 1e9;
  for (std::size_t i = 1; i < corners.size(); ++i) nearest = std::min(nearest, cv::norm(corners[i] - corners[i - 1]));
  Refine(gray, corners, std::clamp(static_cast<int>(nearest / 2.5), 2, 9));
  for (int i = 0; i < static_cast<int>(corners.size()); ++i) {
    const auto& corner = corners[static_cast<std::size_t>(i)];
    view.points_m.emplace_back(board.square_m * (i % board.columns), board.square_m * (i / board.columns), 0.0);
    view.pixels.emplace_back(corner.x, corner.y);
    view.parts.push_back(0);
  }
  return view;
}

BoardView FindTags(const cv::Mat& gray, const Board& board) {
  const auto dictionary = cv::aruco::getPredefinedDictionary(Dictionaries().at(board.dictionary));
  const auto params = cv::aruco::DetectorParameters::create();
  params->minMarkerPerimeterRate = 0.01;
  params->adaptiveThreshWinSizeMax = 43;
  std::vector<std::vector<cv::Point2f>> found;
  std::vector<int> ids;
  cv::aruco::detectMarkers(gray, dictionary, found, ids, params);
  BoardView view;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const auto tag = board.tags.find(ids[i]);
    // One that is seen twice is one of two sheets.
    if (tag == board.tags.end() || std::count(ids.begin(), ids.end(), ids[i]) > 1) continue;
    Refine(gray, found[i], RefineRadius(found[i]));
    for (std::size_t corner = 0; corner < 4; ++corner) {
      view.points_m.push_back(tag->second[corner]);
      view.pixels.emplace_back(found[i][corner].x, found[i][corner].y);
      view.parts.push_back(ids[i]);
    }
  }
  return view;
}

}  // namespace

void Board::Check() const {
  const auto fail = [](const std::string& what) { throw std::invalid_argument(what); };
  if (kind == Kind::kCheckerboard) {
    if (columns < 3 || rows < 3) fail("columns and rows of inner corners must be >= 3");
    if (columns == rows) fail("columns and rows must differ, else which is which cannot be told");
    if (!(square_m > 0.0 && square_m < 10.0)) fail("the squares' size must be > 0, and below 10 m");
    return;
  }
  if (!Dictionaries().count(dictionary)) {
    std::string names;
    for (const auto& [name, number] : Dictionaries()) names += " " + name;
    fail("dictionary '" + dictionary + "' is not known; there are" + names);
  }
  if (tags.empty()) fail("a board needs one tag at least");
  for (const auto& [id, corners] : tags) {
    for (const auto& corner : corners) {
      if (!(corner.norm() < 100.0)) fail("tag " + std::to_string(id) + ": a corner is not a finite place within 100 m");
    }
    if ((corners[1] - corners[0]).norm() < 1e-4) fail("tag " + std::to_string(id) + ": two corners are in one place");
  }
}

bool Board::planar() const {
  return kind == Kind::kCheckerboard || std::all_of(tags.begin(), tags.end(), [](const auto& tag) {
           return std::all_of(tag.second.begin(), tag.second.end(), [](const auto& corner) { return std::abs(corner.z()) < 1e-9; });
         });
}

Board TagGrid(const std::string& dictionary, int columns, int rows, double tag_m, double gap_m, int first_id) {
  Board board;
  board.kind = Board::Kind::kTags;
  board.dictionary = dictionary;
  for (int i = 0; i < columns * rows; ++i) {
    const Eigen::Vector3d at((i % columns) * (tag_m + gap_m), (i / columns) * (tag_m + gap_m), 0.0);
    board.tags[first_id + i] = {at, at + Eigen::Vector3d(tag_m, 0, 0), at + Eigen::Vector3d(tag_m, tag_m, 0),
                                at + Eigen::Vector3d(0, tag_m, 0)};
  }
  return board;
}

BoardView FindBoard(const cv::Mat& gray, const Board& board) {
  board.Check();
  return board.kind == Board::Kind::kCheckerboard ? FindCheckerboard(gray, board) : FindTags(gray, board);
}

}  // namespace vantage::calibration
