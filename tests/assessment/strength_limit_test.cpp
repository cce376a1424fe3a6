#include "assessment/strength_limit.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

namespace vantage::assessment {
namespace {

// Blobs of all strengths, the same everywhere.
cv::Mat Blobs(const cv::Size& size) {
  cv::Mat image(size, CV_8UC3, cv::Scalar::all(128));
  cv::RNG random(3);
  for (int y = 16; y < size.height - 16; y += 20) {
    for (int x = 16; x < size.width - 16; x += 20) {
      const double strength = random.uniform(15.0, 110.0) * (random.uniform(0, 2) == 0 ? 1.0 : -1.0);
      cv::circle(image, {x + random.uniform(-3, 4), y + random.uniform(-3, 4)}, 3, cv::Scalar::all(128.0 + strength), cv::FILLED);
    }
  }
  cv::GaussianBlur(image, image, {}, 1.0);
  return image;
}

features::Features Found(const cv::Mat& image, const features::FeatureParams& params) {
  cv::Mat gray;
  cv::cvtColor(image, gray, cv::COLOR_BGR2GRAY);
  return features::Extract(gray, {}, params);
}

class StrengthLimitTest : public ::testing::Test {
 protected:
  const cv::Mat image_ = Blobs({640, 480});
  features::FeatureParams params_;
};

TEST_F(StrengthLimitTest, IsThatOfTheWholeImage) {
  const int all = Found(image_, params_).size();
  ASSERT_GT(all, 400);
  params_.max_keypoints = all / 2;
  const features::Features kept = Found(image_, params_);
  float weakest = kept.keypoints.front().response;
  for (const cv::KeyPoint& keypoint : kept.keypoints) weakest = std::min(weakest, keypoint.response);
  StrengthLimit limit(image_, kept, params_, {320, 240});
  EXPECT_NEAR(limit.Response({}), weakest, 0.1 * weakest);
  // Half of the light, half of the contrast.
  Disturbance dark;
  dark.brightness = 0.5;
  EXPECT_NEAR(limit.Response(dark), 0.5 * limit.Response({}), 1e-9);
}

TEST_F(StrengthLimitTest, BlurLowersItAndNoiseCompetes) {
  params_.max_keypoints = Found(image_, params_).size() / 2;
  StrengthLimit limit(image_, Found(image_, params_), params_, {320, 240});
  Disturbance blurred, noisy;
  blurred.blur_px = 1.6;
  noisy.image_noise = 16.0;
  EXPECT_LT(limit.Response(blurred), 0.9 * limit.Response({}));
  // A window cut from the blurred image keeps about as many as the blurred image itself has there.
  cv::Mat disturbed = image_.clone();
  Disturb(noisy, 5, &disturbed);
  const features::Features whole = Found(disturbed, params_);
  const auto in_window = std::count_if(whole.keypoints.begin(), whole.keypoints.end(),
                                       [](const cv::KeyPoint& keypoint) { return keypoint.pt.x < 320.f && keypoint.pt.y < 240.f; });
  const features::Features window = Found(disturbed(cv::Rect(0, 0, 320, 240)), params_);
  EXPECT_NEAR(Strongest(window, limit.Response(noisy)).size(), in_window, 0.15 * static_cast<double>(in_window));
}

TEST_F(StrengthLimitTest, IsNoneWhereTheImageKeepsAll) {
  params_.max_keypoints = 100000;
  StrengthLimit limit(image_, Found(image_, params_), params_, {320, 240});
  EXPECT_EQ(limit.Response({}), 0.0);
  EXPECT_EQ(StrengthLimit(image_, {}, params_, {320, 240}).Response({}), 0.0);
}

TEST(Strongest, KeepsOrderAndDescriptors) {
  features::Features features;
  features.descriptors = cv::Mat(3, 2, CV_32F);
  for (int i = 0; i < 3; ++i) {
    features.keypoints.emplace_back(static_cast<float>(i), 0.f, 4.f, 0.f, i == 1 ? 0.1f : 0.5f);
    features.descriptors.at<float>(i, 0) = features.descriptors.at<float>(i, 1) = static_cast<float>(i);
  }
  const features::Features strong = Strongest(features, 0.3);
  ASSERT_EQ(strong.size(), 2);
  EXPECT_EQ(strong.keypoints[1].pt.x, 2.f);
  EXPECT_EQ(strong.descriptors.at<float>(1, 0), 2.f);
}

}  // namespace
}  // namespace vantage::assessment
