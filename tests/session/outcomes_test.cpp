// The table behind the strategy "oracle", in the shipped simulated world.
#include "session/outcomes.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/rigid.h"
#include "simulation/simulated_world.h"

namespace vantage::session {
namespace {

TEST(Outcomes, AViewTeachesWhatIsSeenFromNearItAndNothingOfTheOtherSide) {
  const simulation::SimulatedWorld world(
      simulation::LoadWorldParams(std::filesystem::path(VANTAGE_SOURCE_DIR) / "config" / "worlds" / "table.yaml"));
  const simulation::TrueObject object = world.Truth().front();
  ExploreStart start;
  start.object_name = object.name;
  start.T_world_mesh = object.T_world_object;
  ExploreParams params;
  params.candidates.directions = 24;
  const Judge judge(params.learner.recogniser, object.points);
  int told = 0;
  const exploration::OutcomeTable table =
      MakeOutcomeTable(world, start, params, judge, 1.05, [&](int /*done*/, int all) { told = all; });
  table.Check();
  const std::size_t count = table.viewpoints.size();
  EXPECT_EQ(told, static_cast<int>(count));
  ASSERT_GE(count, 6u);
  int itself = 0;
  for (std::size_t i = 0; i < count; ++i) {
    EXPECT_EQ(table.Nearest(table.viewpoints[i]), i);
    itself += table.Detected(i, i);
    for (std::size_t j = 0; j < count; ++j) {
      const double angle = geometry::AngleBetween(table.viewpoints[i].direction, table.viewpoints[j].direction);
      EXPECT_FALSE(angle > 1.05 && table.Detected(i, j)) << i << " " << j;
    }
  }
  EXPECT_GE(itself, 0.8 * static_cast<double>(count)) << "another picture of what was learned";
}

}  // namespace
}  // namespace vantage::session
