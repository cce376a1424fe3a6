#include <gtest/gtest.h>

#include <set>

#include "exploration/planner.h"
#include "geometry/view_sphere.h"
#include "support.h"

namespace vantage::exploration {
namespace {

geometry::Rigid SomeObjectPose(double tilt_rad) {
  geometry::Rigid T_world_object = geometry::Rigid::Identity();
  T_world_object.translation() = Eigen::Vector3d(0.3, -0.2, 0.1);
  T_world_object.linear() =
      (Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(tilt_rad, Eigen::Vector3d::UnitX())).toRotationMatrix();
  return T_world_object;
}

TEST(SampleCandidates, LooksAtTheObjectFromAboveTheTable) {
  CandidateParams params;
  params.distances_m = {0.4, 0.8};
  const geometry::Rigid T_world_object = SomeObjectPose(0.4);
  const auto candidates = SampleCandidates(T_world_object, params);
  // The share of the sphere between the elevations, times two distances.
  EXPECT_NEAR(static_cast<double>(candidates.size()), 2.0 * 120 * (std::sin(1.4) - std::sin(0.17)) / 2.0, 6.0);
  std::set<int> ids;
  for (const CandidateView& candidate : candidates) {
    const Eigen::Vector3d eye = candidate.T_world_camera.translation() - T_world_object.translation();
    EXPECT_GE(geometry::Elevation(eye), 0.17);
    EXPECT_LE(geometry::Elevation(eye), 1.4);
    EXPECT_NEAR(geometry::AngleBetween(candidate.T_world_camera.linear().col(2), -eye), 0.0, 1e-6);
    EXPECT_LT(candidate.T_world_camera.linear()(2, 1), 0.0) << "the image's down is down in the world";
    const measures::Viewpoint seen = ViewpointOf(candidate.T_world_camera, T_world_object);
    EXPECT_NEAR(geometry::AngleBetween(seen.direction, candidate.viewpoint.direction), 0.0, 1e-6);
    EXPECT_NEAR(seen.distance_m, candidate.viewpoint.distance_m, 1e-9);
    ids.insert(candidate.id);
  }
  EXPECT_EQ(ids.size(), candidates.size());
}

// A better estimate of the pose moves the candidates, but a number means the same view of the object.
TEST(SampleCandidates, NumbersMeanTheSameViewWhereverTheObjectStands) {
  const auto a = SampleCandidates(SomeObjectPose(0.0), {}), b = SampleCandidates(SomeObjectPose(0.1), {});
  int shared = 0;
  for (const CandidateView& one : a) {
    for (const CandidateView& other : b) {
      if (one.id != other.id) continue;
      EXPECT_EQ(one.viewpoint.direction, other.viewpoint.direction);
      ++shared;
    }
  }
  EXPECT_GT(shared, 30);
}

TEST(SampleCandidates, CheckNamesTheField) {
  const auto message = [](const CandidateParams& params) -> std::string {
    try {
      SampleCandidates(geometry::Rigid::Identity(), params);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(message({}), "");
  EXPECT_NE(message({0, 0.1, 1.0, {0.5}}).find("directions"), std::string::npos);
  EXPECT_NE(message({10, 1.1, 1.0, {0.5}}).find("min_elevation_rad"), std::string::npos);
  EXPECT_NE(message({10, 0.1, 3.0, {0.5}}).find("max_elevation_rad"), std::string::npos);
  EXPECT_NE(message({10, 0.1, 1.0, {0.0}}).find("distances_m"), std::string::npos);
  EXPECT_NE(message({10, 0.1, 1.0, {}}).find("distances_m"), std::string::npos);
}

TEST(ViewpointOf, RefusesACameraInsideTheCentre) {
  EXPECT_THROW(ViewpointOf(geometry::Rigid::Identity(), geometry::Rigid::Identity()), std::invalid_argument);
}

}  // namespace
}  // namespace vantage::exploration
