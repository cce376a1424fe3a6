// Small edits that every change of a model needs. Internal to learning.
#pragma once

#include <vector>

#include "model/object_model.h"

namespace vantage::learning {

// Removes the points that no view sees and closes up their indices. Returns where every old point went, -1 = removed.
std::vector<int> DropUnusedPoints(model::ObjectModel* object);

// Keeps only these keypoints of a view (ascending indices), with their descriptors and points.
void KeepKeypoints(const std::vector<int>& kept, model::View* view);

// Pixel of a view's keypoint.
Eigen::Vector2d PixelOf(const model::View& view, int keypoint);

// Where the view with this id is among the views (their ids rise); -1 where it is gone.
int IndexOfView(const model::ObjectModel& object, int id);

// How many points of `a` are seen by `b` too.
int SharedPoints(const model::View& a, const model::View& b);

}  // namespace vantage::learning
