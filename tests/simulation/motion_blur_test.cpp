#include "simulation/motion_blur.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

namespace vantage::simulation {
namespace {

const geometry::PinholeCamera kCamera{320, 240, 300, 300, 159.5, 119.5};

// A black and a white half, parted at column 160.
cv::Mat Halves() {
  cv::Mat picture = cv::Mat::zeros(240, 320, CV_8UC3);
  picture.colRange(160, 320).setTo(cv::Scalar::all(200));
  return picture;
}

cv::Mat Blurred(double depth_m, const Twist& twist, double exposure_s) {
  cv::Mat picture = Halves();
  BlurByMotion(cv::Mat(240, 320, CV_32FC1, cv::Scalar(depth_m)), kCamera, twist, exposure_s, &picture);
  return picture;
}

int Grey(const cv::Mat& picture) {
  cv::Mat grey;
  cv::inRange(picture.row(120), cv::Scalar::all(10), cv::Scalar::all(190), grey);
  return cv::countNonZero(grey);
}

TEST(MotionBlur, AnEdgeIsSpreadOverTheWayItGoes) {
  Twist aside;
  aside.linear_m_s.x() = 1.0;  // 300 px/s at 1 m.
  EXPECT_NEAR(Grey(Blurred(1.0, aside, 0.05)), 15, 2);
  EXPECT_NEAR(Grey(Blurred(2.0, aside, 0.05)), 7.5, 2);
  Twist turn;
  turn.angular_rad_s.y() = 1.0;  // However far.
  EXPECT_NEAR(Grey(Blurred(2.0, turn, 0.05)), 15, 2);
  // Centred: the middle of the edge stays where it is, and the whole as bright as it was.
  const cv::Mat blurred = Blurred(1.0, aside, 0.05);
  EXPECT_NEAR(blurred.at<cv::Vec3b>(120, 159)[0], 100, 12);
  EXPECT_NEAR(cv::mean(blurred)[0], cv::mean(Halves())[0], 0.7);
}

TEST(MotionBlur, AStillCameraAndMotionAlongTheEdgeChangeNothing) {
  EXPECT_EQ(cv::norm(Blurred(1.0, Twist(), 0.05), Halves(), cv::NORM_INF), 0.0);
  Twist aside, upwards;
  aside.linear_m_s.x() = 0.01;
  upwards.linear_m_s.y() = 1.0;
  EXPECT_EQ(cv::norm(Blurred(1.0, aside, 0.05), Halves(), cv::NORM_INF), 0.0);
  EXPECT_LE(cv::norm(Blurred(1.0, upwards, 0.05), Halves(), cv::NORM_INF), 1.0);
}

}  // namespace
}  // namespace vantage::simulation
