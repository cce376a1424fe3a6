#include "learning/upkeep.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "box_orbit.h"
#include "learning/refinement.h"

namespace vantage::learning {
namespace {

using testing::BoxOrbit;
using testing::BoxOrbitOptions;

BoxOrbitOptions Quarter(int views) {
  BoxOrbitOptions options;
  options.views = views;
  options.turn_deg = 40;
  options.drift_m = options.drift_deg = options.wrong_links = 0;
  return options;
}

UpkeepParams KeepAll() {
  UpkeepParams params;
  params.max_descriptors = 1000;
  params.redundant_angle_deg = 0;
  params.min_view_points = 0;
  return params;
}

TEST(Upkeep, NothingGoesWhereNothingIsTooMuch) {
  const BoxOrbit orbit(Quarter(5));
  UpkeepReport report;
  const model::ObjectModel kept = Kept(orbit.object(), {}, UpkeepParams{}, &report);
  EXPECT_EQ(kept.views.size(), orbit.object().views.size());
  EXPECT_EQ(kept.points.size(), orbit.object().points.size());
  EXPECT_EQ(report.descriptors_dropped, 0);
}

TEST(Upkeep, FailingPointsGoAndTheirIndicesCloseUp) {
  const BoxOrbit orbit(Quarter(5));
  const model::ObjectModel& object = orbit.object();
  std::vector<PointStatistics> statistics(object.points.size(), {100, 60});
  statistics[3] = {100, 2};
  statistics[4] = {10, 0};  // Too early to say.
  UpkeepReport report;
  const model::ObjectModel kept = Kept(object, statistics, KeepAll(), &report);
  EXPECT_EQ(report.failing_points, 1);
  EXPECT_EQ(kept.points.size() + 1, object.points.size());
  EXPECT_EQ(kept.points[3].position, object.points[4].position);
  std::vector<int> new_index;
  Rebased(object, kept, object, &new_index);
  EXPECT_EQ(new_index[3], -1);
  EXPECT_EQ(new_index[4], 3);
  EXPECT_THROW(Kept(object, std::vector<PointStatistics>(2), KeepAll()), std::invalid_argument);
}

TEST(Upkeep, RedundantViewsGoButNeitherTheFirstNorTheNewest) {
  const BoxOrbit orbit(Quarter(17));  // 2.5 degrees apart.
  UpkeepParams params = KeepAll();
  params.redundant_angle_deg = 6.0;
  UpkeepReport report;
  const model::ObjectModel kept = Kept(orbit.object(), {}, params, &report);
  EXPECT_GE(kept.views.size(), 5u);
  EXPECT_LE(kept.views.size(), 8u);
  EXPECT_EQ(report.views_dropped, 17 - static_cast<int>(kept.views.size()));
  EXPECT_EQ(kept.views.front().id, 0);
  EXPECT_EQ(kept.views.back().id, 16);
  for (size_t a = 0; a < kept.views.size(); ++a) {
    for (size_t b = a + 1; b < kept.views.size(); ++b) {
      EXPECT_GE(geometry::AngleBetween(kept.views[a].viewpoint().direction, kept.views[b].viewpoint().direction), 5.9 * M_PI / 180);
    }
  }
}

TEST(Upkeep, DescriptorsOfAPointAreBoundedAndTheMostDifferentStay) {
  const BoxOrbit orbit(Quarter(12));
  UpkeepParams params = KeepAll();
  params.max_descriptors = 4;
  UpkeepReport report;
  const model::ObjectModel kept = Kept(orbit.object(), {}, params, &report);
  EXPECT_EQ(kept.points.size(), orbit.object().points.size());
  EXPECT_GT(report.descriptors_dropped, 0);
  std::map<int, int> count;
  for (const model::View& view : kept.views) {
    for (const int point : view.points) EXPECT_LE(++count[point], 4);
  }
}

TEST(Upkeep, TheModelStopsGrowingOnceTheOrbitIsCovered) {
  BoxOrbitOptions options = Quarter(12);
  BoxOrbit orbit(options);
  UpkeepParams params;
  params.max_descriptors = 6;
  model::ObjectModel base = orbit.object(), kept = Kept(base, {}, params);
  std::vector<size_t> views, points;
  for (int round = 0; round < 6; ++round) {
    for (double azimuth_deg = 1.0 + round; azimuth_deg < 40; azimuth_deg += 7) orbit.AddView(azimuth_deg * M_PI / 180);
    kept = Kept(Rebased(base, kept, orbit.object()), {}, params);
    base = orbit.object();
    views.push_back(kept.views.size());
    points.push_back(kept.points.size());
  }
  EXPECT_LE(views.back(), views.front() + 3);
  EXPECT_LE(views.back(), 14u);
}

TEST(Upkeep, ThereAreNeverMoreViewsThanAllowed) {
  const BoxOrbit orbit(Quarter(10));
  UpkeepParams params = KeepAll();
  params.redundant_angle_deg = 1.0;
  params.max_views = 4;
  const model::ObjectModel kept = Kept(orbit.object(), {}, params);
  EXPECT_EQ(kept.views.size(), 4u);
  EXPECT_EQ(kept.views.front().id, 0);
  EXPECT_EQ(kept.views.back().id, 9);
}

}  // namespace
}  // namespace vantage::learning
