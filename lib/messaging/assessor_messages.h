// Viewpoints, measures and completeness on the wire.
#pragma once

#include <cstdint>
#include <string>
#include <vantage/completeness_t.hpp>
#include <vantage/measures_t.hpp>
#include <vantage/reach_t.hpp>
#include <vantage/viewpoint_t.hpp>
#include <vector>

#include "geometry/view_sphere.h"
#include "measures/completeness.h"
#include "messaging/result.h"

namespace vantage::messaging {

viewpoint_t ToMessage(const measures::Viewpoint& viewpoint);
// Refuses directions that are not of unit length (within 1 %) and distances that are not in (0, 100] m.
Result<measures::Viewpoint> FromMessage(const viewpoint_t& message);

struct ObjectMeasures {
  std::int64_t utime = 0;  // Capture time of the newest view in the fit.
  std::string object;
  int views = 0;  // Whose trials are in the fit.
  measures::Measures measures;
  double completeness = 0.0;
};
measures_t ToMessage(const ObjectMeasures& measures);
// Refuses other grids, counts out of range, sigmas that are not positive, unknown sources.
Result<ObjectMeasures> FromMessage(const measures_t& message);

struct ObjectCompleteness {
  std::int64_t utime = 0;  // Capture time of the newest view.
  std::string object;
  measures::CompletenessRule rule = measures::CompletenessRule::kMax;
  double completeness = 0.0;
  bool reach_known = false;
  double distance_m = 1.0;  // Of the cells.
  geometry::ViewSphere sphere;
  std::vector<double> cells;  // Detection probability per cell of `sphere`.
  std::vector<measures::Viewpoint> views;
};
completeness_t ToMessage(const ObjectCompleteness& completeness);
Result<ObjectCompleteness> FromMessage(const completeness_t& message);

struct Reach {
  std::int64_t utime = 0;
  std::string object;
  std::vector<measures::WeightedViewpoint> viewpoints;
};
reach_t ToMessage(const Reach& reach);
// Refuses weights that are negative or not finite.
Result<Reach> FromMessage(const reach_t& message);

}  // namespace vantage::messaging
