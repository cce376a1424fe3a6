// Which connected surfaces are parts of one object. Internal to segmentation.
#pragma once

#include <set>
#include <utility>
#include <vector>

#include "rgbd/frame.h"
#include "segmentation/clusters.h"
#include "segmentation/parts.h"

namespace vantage::segmentation {

// Joins parts that belong together, largest first, until nothing changes; never beyond the largest size of an object:
// - one lies within the other, seen from above and from the side (what stands on top of something does not), more clearly so where
//   they meet in a crease (pairs of Part::surfaces);
// - together they are the inside and the outside of a vessel: one rim, closed and empty, of which the far part is the hollow side;
// - one floats beside the other, resting on nothing (a handle);
// - a nearer object hides what is between them, or nothing was measured there, and the surface of the one goes on in the other.
void JoinParts(const rgbd::Frame& frame, const cv::Mat& states, const cv::Mat& cloud,
               const std::set<std::pair<int, int>>& in_crease, const ClusterParams& params, std::vector<Part>* parts);

}  // namespace vantage::segmentation
