// What stands on the table, in world coordinates: the planner's obstacles.
#pragma once

#include <vector>

#include "segmentation/clusters.h"

namespace vantage::learning {

// Surface points of a cluster and their feet on the table (so that the hull reaches down to it), at most about `max_points`, world
// coordinates, metres. Empty where the frame's camera pose is not known. By default so many that no corner is missed: of a box that
// fills a quarter of the image every fourth pixel.
std::vector<Eigen::Vector3d> ClusterHullPoints(const rgbd::Frame& frame, const segmentation::Plane& plane,
                                               const segmentation::Cluster& cluster, int max_points = 10000);

}  // namespace vantage::learning
