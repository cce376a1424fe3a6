// What refinement beside tracking makes of views that are wrong.
#include "learning/refiner.h"

#include <gtest/gtest.h>

#include "box_orbit.h"
#include "learning/model_edit.h"

namespace vantage::learning {
namespace {

model::ObjectModel ShortOrbit() {
  testing::BoxOrbitOptions options;
  options.views = 10;
  options.turn_deg = 90.0;
  return testing::BoxOrbit(options).object();
}

Refinement RefinedWith(const model::ObjectModel& object) {
  Refiner refiner{LearnerParams{}};
  EXPECT_FALSE(refiner.IsDue());
  refiner.ViewAdded(object.views.back().id);
  EXPECT_TRUE(refiner.IsDue());
  refiner.Start(1, std::make_shared<const model::ObjectModel>(object), {}, {});
  return *refiner.Finish();
}

TEST(Refiner, AViewWhoseLinksWereWrongGoes) {
  model::ObjectModel object = ShortOrbit();
  const int newest = object.views.back().id;
  const Refinement right = RefinedWith(object);
  EXPECT_EQ(right.dropped, 0);
  EXPECT_GE(IndexOfView(right.changed, newest), 0);

  // Every keypoint is said to have seen the point of another one.
  std::vector<int>& points = object.views.back().points;
  std::rotate(points.begin(), points.begin() + points.size() / 3, points.end());
  const Refinement wrong = RefinedWith(object);
  EXPECT_EQ(wrong.dropped, 1);
  EXPECT_LT(IndexOfView(wrong.changed, newest), 0);
  EXPECT_EQ(wrong.changed.views.size(), object.views.size() - 1);
}

}  // namespace
}  // namespace vantage::learning
