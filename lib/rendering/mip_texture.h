// A texture with mip levels and the filter that reads it through a pixel's footprint. Internal to rendering.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

namespace vantage::rendering {

class MipTexture {
 public:
  MipTexture() = default;
  // `texture` CV_8UC3 is shared, not copied; the smaller levels take a third of its memory.
  explicit MipTexture(const cv::Mat& texture);

  // The mean colour (BGR, 0 to 255) of the parallelogram that a pixel covers: `uv` its centre (v up, repeated beyond [0, 1]),
  // `duv_dx` and `duv_dy` its edges. Trilinear along the short axis, up to 8 probes along the long one.
  Eigen::Vector3f Sample(const Eigen::Vector2f& uv, const Eigen::Vector2f& duv_dx, const Eigen::Vector2f& duv_dy) const;

 private:
  Eigen::Vector3f Bilinear(int level, float u, float v_down) const;
  Eigen::Vector3f Trilinear(float level, float u, float v_down) const;

  std::vector<cv::Mat> levels_;
};

}  // namespace vantage::rendering
