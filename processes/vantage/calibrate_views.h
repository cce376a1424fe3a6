// Views of a board to calibrate from: images in a folder, an LCM log, or the live bus.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "calibration/board.h"
#include "geometry/rigid.h"
#include "messaging/log.h"
#include "rgbd/frame.h"

namespace vantage::cli {

struct SeenBoard {
  std::string name;  // The file, or the time of capture.
  calibration::BoardView board;
  std::optional<geometry::Rigid> T_world_mount;  // Where the mount said it was then.
};

struct SeenBoards {
  std::vector<SeenBoard> views;
  geometry::PinholeCamera camera;  // The images' size; of frames also what they say of the camera.
  int images = 0;                  // Looked at.
};

// Every image of a folder (its rgb/ where it has one) in which the board is. Throws std::runtime_error: no images, sizes that
// differ.
SeenBoards ViewsOfFolder(const std::string& folder, const calibration::Board& board);

// Which images of a stream are taken: the board stands still in them, and elsewhere than in those taken before.
struct StreamParams {
  int views = 30;             // Ends with so many.
  double seconds = 300.0;     // Ends after this time of the stream.
  double min_move = 0.04;     // Points differ from every view taken by this share of the image's width in the mean...
  double max_shake_px = 1.5;  // ...and from the image before by less.
  bool with_mount = false;    // Only images of which the mount's pose is known.
};

// `tell` hears of every view that is taken. Throws as LogReader and Bus do.
using Tell = std::function<void(int views, const std::string& text)>;
SeenBoards ViewsOfLog(const std::string& log, const calibration::Board& board, const StreamParams& params);
SeenBoards ViewsOfBus(const std::string& url, const calibration::Board& board, const StreamParams& params, const Tell& tell);

}  // namespace vantage::cli
