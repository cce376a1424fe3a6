// Recordings as BOP scene folders: rgb/, depth/, label/, scene_camera.json, scene_gt.json; folders of the TUM RGB-D benchmark are
// taken as well (tum.h): their frames count from 0, and keep their times.
#pragma once

#include <filesystem>
#include <map>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "rgbd/frame.h"
#include "rgbd/tum.h"

namespace vantage::rgbd {

// True pose of one object in one frame.
struct ObjectTruth {
  int object_id = 0;                // BOP object number.
  geometry::Rigid T_camera_object;  // Mesh coordinates to camera, metres.
};

// A scene folder. Opening it reads the JSON files only; images are read as they are asked for.
class BopScene {
 public:
  // Throws std::runtime_error with the file's name and what to do: no folder, no scene_camera.json, broken JSON, a field missing.
  explicit BopScene(const std::filesystem::path& folder);

  const std::filesystem::path& folder() const { return folder_; }
  const std::vector<int>& ids() const { return ids_; }  // Ascending.

  // Reads one frame: colour, depth where there is depth/, the pose where the recording knows it.
  // Throws std::runtime_error naming the file: missing, not an image, depth of another size than colour, unknown id.
  Frame Load(int id) const;

  // Where the camera was, without reading an image; nullopt where the recording does not know it or has no such frame.
  std::optional<geometry::Rigid> CameraPose(int id) const;

  // Label image (CV_8UC1), empty where the scene has none.
  cv::Mat LoadLabel(int id) const;

  // Empty where the scene has no truth for it.
  const std::vector<ObjectTruth>& Truth(int id) const;
  bool has_truth() const { return !truth_.empty(); }

 private:
  struct CameraEntry {
    geometry::PinholeCamera camera;  // Width and height are 0 until an image was read.
    double depth_scale = 1.0;
    std::optional<geometry::Rigid> T_world_camera;
    std::optional<TumFrame> tum;  // Of TUM folders: files and time.
  };

  void OpenTum();

  std::filesystem::path folder_;
  std::vector<int> ids_;
  std::map<int, CameraEntry> cameras_;
  std::map<int, std::vector<ObjectTruth>> truth_;
};

// Which of a scene's frames: "all", "even" or "odd" (by id), or "A:B" (ids A..B-1, either may be empty).
// Throws std::invalid_argument on other text.
std::vector<int> SelectFrames(const std::vector<int>& ids, const std::string& selection);

}  // namespace vantage::rgbd
