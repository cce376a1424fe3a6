#include "vantage/board_file.h"

#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "config/yaml.h"

namespace vantage::cli {
namespace {

using calibration::Board;

Board LoadTags(const std::filesystem::path& file) {
  std::ifstream stream(file);
  if (!stream) throw std::runtime_error(file.string() + ": no such file; it is to hold the corners of the board's tags");
  Board board;
  board.kind = Board::Kind::kTags;
  try {
    const auto json = nlohmann::json::parse(stream);
    for (const auto& [key, corners] : json.items()) {
      if (key.empty() || key.find_first_not_of("0123456789") != std::string::npos) continue;
      for (std::size_t i = 0; i < 4; ++i) {
        const auto xyz = corners.at(i).get<std::array<double, 3>>();
        board.tags[std::stoi(key)][i] = Eigen::Vector3d(xyz[0], xyz[1], xyz[2]) * 1e-3;
      }
    }
  } catch (const std::exception& error) {
    throw std::runtime_error(file.string() + ": expected {\"ID\": [four corners [x, y, z] in mm], ...}, found: " + error.what());
  }
  return board;
}

Board LoadYaml(const std::filesystem::path& file) {
  auto yaml = config::Mapping::Load(file);
  std::string kind = "checkerboard";
  yaml.Get("kind", kind);
  Board board;
  if (kind == "checkerboard") {
    double square_mm = 1e3 * board.square_m;
    yaml.Get("columns", board.columns);
    yaml.Get("rows", board.rows);
    yaml.Get("square_mm", square_mm);
    board.square_m = 1e-3 * square_mm;
  } else if (kind == "tag_grid") {
    int columns = 6, rows = 4, first_id = 0;
    double tag_mm = 40.0, gap_mm = 12.0;
    yaml.Get("dictionary", board.dictionary);
    yaml.Get("columns", columns);
    yaml.Get("rows", rows);
    yaml.Get("tag_mm", tag_mm);
    yaml.Get("gap_mm", gap_mm);
    yaml.Get("first_id", first_id);
    if (columns < 1 || rows < 1 || columns * rows > 1000)
      yaml.Fail("columns", "columns and rows must be >= 1, with 1000 tags at most");
    board = calibration::TagGrid(board.dictionary, columns, rows, 1e-3 * tag_mm, 1e-3 * gap_mm, first_id);
  } else if (kind == "tags") {
    std::string dictionary = board.dictionary, corners;
    yaml.Get("dictionary", dictionary);
    yaml.Get("corners", corners);
    if (corners.empty()) yaml.Fail("corners", "must name the JSON file of the tags' corners");
    board = LoadTags(file.parent_path() / corners);
    board.dictionary = dictionary;
  } else {
    yaml.Fail("kind", "must be checkerboard, tag_grid or tags, is '" + kind + "'");
  }
  yaml.Finish();
  yaml.Check(board);
  return board;
}

}  // namespace

Board LoadBoard(const std::filesystem::path& file) {
  if (file.extension() != ".json") return LoadYaml(file);
  const Board board = LoadTags(file);
  try {
    board.Check();
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(file.string() + ": " + error.what());
  }
  return board;
}

}  // namespace vantage::cli
