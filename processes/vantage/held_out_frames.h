// Frames as they are held out to judge: seen in colour alone, as their depth may have been rendered from the truth.
#pragma once

#include <optional>
#include <vector>

#include "assessment/held_out.h"

namespace vantage::cli {

// `T_camera_mesh`: nullopt where the object is not there. It counts where at least half of the object's points lie in the image.
assessment::HeldOutFrame HoldOut(rgbd::Frame frame, const std::optional<geometry::Rigid>& T_camera_mesh,
                                 const assessment::Truth& truth);

// Interest points of all, which then need no colour any more. All cores.
void FindFeatures(const recognition::RecogniserParams& recogniser, std::vector<assessment::HeldOutFrame>* frames);

}  // namespace vantage::cli
