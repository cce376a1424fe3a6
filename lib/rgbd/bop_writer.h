// Writes frames as a BOP scene folder that BopScene reads.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "rgbd/codec.h"
#include "rgbd/frame.h"

namespace vantage::rgbd {

class BopWriter {
 public:
  // Makes the folder with rgb/ and depth/. Throws std::runtime_error naming it: it holds a scene already, it cannot be made.
  explicit BopWriter(const std::filesystem::path& folder);

  // Writes the frame's images under `id`, 0 or greater and not written yet (else std::invalid_argument). `color`: the colour image
  // as the JPEG or PNG it came as, written as it is; empty: as PNG, lossless. Frames either all have depth or none has. Throws
  // std::runtime_error naming the file where it cannot be written.
  void Add(int id, const Frame& frame, const Bytes& color = {});

  // Writes scene_camera.json: a folder without it was broken off.
  void Finish();

  int frames() const { return static_cast<int>(cameras_.size()); }

 private:
  std::filesystem::path folder_;
  std::map<int, std::string> cameras_;  // The entry of every frame, as JSON.
};

}  // namespace vantage::rgbd
