// From where is an object recognised that was learned from one view alone? The truth behind the strategy "oracle".
#pragma once

#include <functional>

#include "exploration/planner.h"
#include "session/explore.h"
#include "session/judge.h"

namespace vantage::session {

// Learns the object from each of many views alone and tries to recognise it from every other one less than `max_angle_rad` away
// in direction; further ones count as failed, as do views from which nothing is learned. The views are the recorded ones, or the
// candidates of at most 120 directions over the whole sphere, whose outcomes stand for those between. `judge` knows the true
// surface. Cost: views squared times that angle's share of the sphere, some 50 ms each: a minute for 50 views on one core.
exploration::OutcomeTable MakeOutcomeTable(const simulation::World& world, const ExploreStart& start, const ExploreParams& params,
                                           const Judge& judge, double max_angle_rad = 1.05,
                                           const std::function<void(int done, int all)>& progress = {});

}  // namespace vantage::session
