// Calibration boards as files.
#pragma once

#include <filesystem>

#include "calibration/board.h"

namespace vantage::cli {

// YAML, `kind` first: `checkerboard` (columns, rows of inner corners, square_mm), `tag_grid` (dictionary, columns, rows, tag_mm,
// gap_mm, first_id), `tags` (dictionary, corners: a JSON file beside it). Or such a JSON file itself, of 36h11 tags: {"ID": [[x, y,
// z], ...], ...} with four corners in mm, clockwise as printed; keys that are no numbers are passed over. Throws std::runtime_error
// that names the file.
calibration::Board LoadBoard(const std::filesystem::path& file);

}  // namespace vantage::cli
