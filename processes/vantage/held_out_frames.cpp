#include "vantage/held_out_frames.h"

#include <opencv2/core/utility.hpp>

#include "session/judge.h"

namespace vantage::cli {

assessment::HeldOutFrame HoldOut(rgbd::Frame frame, const std::optional<geometry::Rigid>& T_camera_mesh,
                                 const assessment::Truth& truth) {
  constexpr double kMinShareInImage = 0.5;
  assessment::HeldOutFrame held_out;
  held_out.frame = std::move(frame);
  held_out.frame.depth = cv::Mat();
  held_out.frame.T_world_camera.reset();
  held_out.T_camera_mesh = T_camera_mesh;
  held_out.counts =
      T_camera_mesh && session::ShareInImage(truth.points_in_mesh, *T_camera_mesh, held_out.frame.camera) >= kMinShareInImage;
  return held_out;
}

void FindFeatures(const recognition::RecogniserParams& params, std::vector<assessment::HeldOutFrame>* frames) {
  const recognition::Recogniser recogniser(params);
  cv::parallel_for_(cv::Range(0, static_cast<int>(frames->size())), [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i) {
      assessment::HeldOutFrame& held_out = (*frames)[static_cast<std::size_t>(i)];
      held_out.features = recogniser.Extract(held_out.frame);
      held_out.frame.color = cv::Mat();
    }
  });
}

}  // namespace vantage::cli
