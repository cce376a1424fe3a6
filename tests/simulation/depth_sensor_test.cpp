#include "simulation/depth_sensor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

namespace vantage::simulation {
namespace {

constexpr int kWidth = 320, kHeight = 240;

// A wall at `wall_m`, before it a box's face at `near_m` over the columns [left, right).
rendering::Image Scene(float wall_m, float near_m = 0.0f, int left = 0, int right = 0) {
  rendering::Image image;
  image.depth = cv::Mat(kHeight, kWidth, CV_32FC1, cv::Scalar(wall_m));
  image.grazing = cv::Mat(kHeight, kWidth, CV_32FC1, cv::Scalar(1.0));
  if (right > left) image.depth.colRange(left, right).setTo(near_m);
  return image;
}

SensorParams Bare() {
  SensorParams params;
  params.depth_noise = params.depth_quantised = params.depth_holes = params.depth_shadows = false;
  return params;
}

cv::Mat Measure(const rendering::Image& image, const SensorParams& params, std::uint64_t seed = 1) {
  static const NoiseTable table;
  return MeasuredDepth(image, params, table.StreamOf(seed));
}

cv::Mat Error_mm(const cv::Mat& measured, double true_m) {
  cv::Mat error;
  measured.convertTo(error, CV_32F, 1.0, -1e3 * true_m);
  return error;
}

double Deviation(const cv::Mat& values) {
  cv::Scalar mean, deviation;
  cv::meanStdDev(values, mean, deviation);
  return deviation[0];
}

TEST(DepthSensor, WithAllSwitchedOffDepthIsExact) {
  const cv::Mat measured = Measure(Scene(1.0f, 0.6f, 100, 200), Bare());
  EXPECT_EQ(cv::countNonZero(measured == 1000), kHeight * (kWidth - 100));
  EXPECT_EQ(cv::countNonZero(measured == 600), kHeight * 100);
}

// The whole deviation is the published one, with and without quantisation, near and far. (A slanted wall: on one parallel to the
// image a step's error is not spread evenly.)
TEST(DepthSensor, TheWholeErrorIsTheKinects) {
  for (const bool quantised : {false, true}) {
    for (const float z : {0.5f, 0.7f, 1.0f, 1.5f, 2.0f}) {
      SensorParams params = Bare();
      params.depth_noise = true;
      params.depth_quantised = quantised;
      rendering::Image image = Scene(z);
      for (int y = 0; y < kHeight; ++y) image.depth.row(y).setTo(z + 2e-4f * static_cast<float>(y - kHeight / 2));
      const double expected_mm = 1.2 + 1.9 * (z - 0.4) * (z - 0.4);
      cv::Mat error;
      Measure(image, params).convertTo(error, CV_32F);
      error -= 1e3 * image.depth;
      EXPECT_NEAR(Deviation(error), expected_mm, 0.06 * expected_mm) << z << (quantised ? " quantised" : "");
      EXPECT_LT(std::abs(cv::mean(error)[0]), 0.12 * expected_mm) << z;
    }
  }
}

TEST(DepthSensor, DisparityComesInSteps) {
  SensorParams params = Bare();
  params.depth_noise = params.depth_quantised = true;
  const cv::Mat measured = Measure(Scene(1.0f), params);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double z = measured.at<std::uint16_t>(y, x) * 1e-3;
      const double steps = params.focal_length_px * params.baseline_m / z / params.disparity_step_px;
      // Millimetres are as fine as a sixth of a step here.
      ASSERT_NEAR(steps, std::round(steps), 0.17) << z;
    }
  }
}

TEST(DepthSensor, NeighboursErrAlike) {
  const auto correlation = [](const cv::Mat& error, int dx, int dy) {
    const cv::Mat a = error(cv::Rect(0, 0, kWidth - dx, kHeight - dy)), b = error(cv::Rect(dx, dy, kWidth - dx, kHeight - dy));
    return a.dot(b) / (cv::norm(a) * cv::norm(b));
  };
  SensorParams params = Bare();
  params.depth_noise = true;
  const cv::Mat error = Error_mm(Measure(Scene(1.0f), params), 1.0);
  const double s = params.noise_correlation_px;
  for (const int lag : {1, 2, 3}) {
    EXPECT_NEAR(correlation(error, lag, 0), std::exp(-lag * lag / (4 * s * s)), 0.06) << lag;
    EXPECT_NEAR(correlation(error, 0, lag), std::exp(-lag * lag / (4 * s * s)), 0.06) << lag;
  }
  params.noise_correlation_px = 0.0;
  EXPECT_NEAR(correlation(Error_mm(Measure(Scene(1.0f), params), 1.0), 1, 0), 0.0, 0.02);
  // Another frame errs otherwise.
  const cv::Mat other = Error_mm(Measure(Scene(1.0f), params, 2), 1.0), first = Error_mm(Measure(Scene(1.0f), params, 1), 1.0);
  EXPECT_NEAR(first.dot(other) / (cv::norm(first) * cv::norm(other)), 0.0, 0.02);
}

// Left of a near object is what the projector does not light, right of it what the infrared camera does not see: as wide as the
// disparities' difference, 2 to 1 in all.
TEST(DepthSensor, ShadowsLieBesideNearObjects) {
  SensorParams params = Bare();
  params.depth_shadows = true;
  const cv::Mat measured = Measure(Scene(1.0f, 0.6f, 150, 200), params);
  const double difference_px = params.focal_length_px * (1.0 / 0.6 - 1.0);
  const int left = cv::countNonZero(measured.row(100).colRange(0, 150) == 0);
  const int right = cv::countNonZero(measured.row(100).colRange(200, kWidth) == 0);
  EXPECT_NEAR(left, 0.05 * difference_px, 1.01);
  EXPECT_NEAR(right, 0.025 * difference_px, 1.01);
  EXPECT_EQ(cv::countNonZero(measured.row(100).colRange(150, 200) == 0), 0);
  EXPECT_EQ(measured.at<std::uint16_t>(100, 149), 0);
  EXPECT_EQ(measured.at<std::uint16_t>(100, 200), 0);
  EXPECT_EQ(cv::countNonZero(Measure(Scene(1.0f), params) == 0), 0);
}

TEST(DepthSensor, HolesAtGrazingAnglesAndJumps) {
  SensorParams params = Bare();
  params.depth_holes = true;
  rendering::Image image = Scene(1.0f, 0.6f, 150, 200);
  image.grazing.rowRange(0, 20).setTo(0.1);  // 84 degrees.
  const cv::Mat measured = Measure(image, params);
  EXPECT_EQ(cv::countNonZero(measured.rowRange(0, 20)), 0);
  EXPECT_EQ(cv::countNonZero(measured.col(149)), 0);
  EXPECT_GT(cv::countNonZero(measured.col(150)), 100);
  EXPECT_EQ(cv::countNonZero(measured.rowRange(20, kHeight).col(250) == 0), 0);
}

}  // namespace
}  // namespace vantage::simulation
