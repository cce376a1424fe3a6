// Keeps a model's size bounded and its points good while views keep coming.
#pragma once

#include <vector>

#include "model/object_model.h"

namespace vantage::learning {

// How a model point fared while the object was tracked; kept by the caller, one per point (carry it over with Rebased's new_index).
struct PointStatistics {
  int visible = 0;  // Frames in which it ought to have been seen.
  int seen = 0;     // Those in which an interest point supported it.
};

struct UpkeepParams {
  int max_descriptors = 10;          // Views that keep a feature of one point, the most different; >= 2.
  int min_visible = 30;              // A point is judged after it ought to have been seen so often; >= 1.
  double min_seen_share = 0.08;      // ...and dropped where it was seen in a smaller share; [0, 1).
  double redundant_angle_deg = 6.0;  // Two views nearer in direction than this...; >= 0.
  double redundant_octaves = 0.25;   // ...and in distance than this are one too many; >= 0.
  int max_views = 150;               // More are thinned out, the most crowded first; >= 2.
  int min_view_points = 0;           // A view left with fewer features is dropped; >= 0.

  void Check() const;  // Throws std::invalid_argument naming the field.
};

struct UpkeepReport {
  int views_dropped = 0;
  int points_dropped = 0;       // All causes.
  int failing_points = 0;       // Of these: for failing.
  int descriptors_dropped = 0;  // All causes.
};

// The model without failing points, redundant views and surplus descriptors. Of two redundant views the one that has others
// nearer by goes, or else the one with fewer points of its own. The first view never goes (it holds the object frame) nor the
// newest (it is being tracked). View ids and the order of views, features and points stay; indices close up. `statistics` may be
// empty: nothing is judged as failing. Throws std::invalid_argument where statistics are neither empty nor one per point. Cost:
// about 20 ms for 100 views of 300 features.
model::ObjectModel Kept(const model::ObjectModel& object, const std::vector<PointStatistics>& statistics,
                        const UpkeepParams& params, UpkeepReport* report = nullptr);

}  // namespace vantage::learning
