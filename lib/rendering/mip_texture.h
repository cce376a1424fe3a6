// A texture with mip levels and the filter that reads it through a pixel's footprint. Internal to rendering.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

namespace vantage::rendering {

class MipTexture {
 public:
  MipTexture() = default;
  // `texture` CV_8UC3, copied; with the smaller levels 4/3 of its memory.
  explicit MipTexture(const cv::Mat& texture);

  // The mean colour (BGR, 0 to 255) of the parallelogram that a pixel covers: `uv` its centre (v up, repeated beyond [0, 1]),
  // `duv_dx` and `duv_dy` its edges. Trilinear across, up to 8 probes along the longer edge.
  Eigen::Vector3f Sample(const Eigen::Vector2f& uv, const Eigen::Vector2f& duv_dx, const Eigen::Vector2f& duv_dy) const;

 private:
  struct Level {
    cv::Mat image;  // Has one row more than `rows`, so that four bytes can be read at every texel.
    const std::uint8_t* data = nullptr;
    std::size_t step = 0;
    int columns = 0;
    int rows = 0;
  };
  std::vector<Level> levels_;
};

}  // namespace vantage::rendering
