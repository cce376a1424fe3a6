#include "session/judge.h"

#include <gtest/gtest.h>

namespace vantage::session {
namespace {

TEST(Judge, KnowsWhichViewsLookFromWhere) {
  Judge judge({}, Eigen::Matrix3Xd::Zero(3, 1));
  rgbd::Frame frame;
  frame.camera = {80, 60, 100.0, 100.0, 40.0, 30.0};
  frame.color = cv::Mat::zeros(60, 80, CV_8UC3);
  for (const double azimuth_deg : {0.0, 40.0, 180.0}) {
    const double azimuth = azimuth_deg * M_PI / 180.0;
    const Eigen::Vector3d eye(std::cos(azimuth), std::sin(azimuth), 0.0);
    ASSERT_TRUE(judge.Add(frame, geometry::LookAt(eye, Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ()).inverse()));
  }
  geometry::Rigid T_mesh_object = geometry::Rigid::Identity();
  EXPECT_EQ(judge.Near(Eigen::Vector3d::UnitX(), T_mesh_object, 0.8), (std::vector<char>{1, 1, 0}));
  EXPECT_EQ(judge.Near(Eigen::Vector3d::UnitX(), T_mesh_object, 0.5), (std::vector<char>{1, 0, 0}));
  T_mesh_object.linear() = Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  EXPECT_EQ(judge.Near(Eigen::Vector3d::UnitX(), T_mesh_object, 0.5), (std::vector<char>{0, 0, 1})) << "the object's coordinates";
}

}  // namespace
}  // namespace vantage::session
