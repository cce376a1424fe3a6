// A world that needs no files but those the test writes: boxes that wear a random picture.
#pragma once

#include <unistd.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "simulation/simulated_world.h"

namespace vantage::simulation::testing {

class PictureFolder {
 public:
  PictureFolder() : folder_(std::filesystem::temp_directory_path() / ("pictures_" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(folder_);
    cv::Mat picture(200, 300, CV_8UC3);
    cv::RNG random(3);
    random.fill(picture, cv::RNG::UNIFORM, 0, 255);
    cv::GaussianBlur(picture, picture, {}, 2.0);
    cv::normalize(picture, picture, 0, 255, cv::NORM_MINMAX);
    cv::imwrite((folder_ / "picture.png").string(), picture);
  }
  ~PictureFolder() { std::filesystem::remove_all(folder_); }
  const std::filesystem::path& path() const { return folder_; }

  // A table with boxes of these sizes at these places, wearing the picture.
  WorldParams World(const std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>>& size_and_position) const {
    WorldParams params;
    params.texture_folders = {folder_.string()};
    for (const auto& [size_m, position_m] : size_and_position) {
      ObjectParams box;
      box.name = "box" + std::to_string(params.objects.size());
      box.box_m = size_m;
      box.position_m = position_m;
      box.faces = {"picture.png"};
      params.objects.push_back(box);
    }
    return params;
  }

 private:
  std::filesystem::path folder_;
};

}  // namespace vantage::simulation::testing
