#include "assessment/strength_limit.h"

#include <gtest/gtest.h>

#include <algorithm>
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

cv::Mat Gray(const cv::Mat& image) {
  cv::Mat gray;
  cv::cvtColor(image, gray, cv::COLOR_BGR2GRAY);
  return gray;
}

features::Features Found(const cv::Mat& image, const features::FeatureParams& params) {
  return features::Extract(Gray(image), {}, params);
}

// Place, direction and descriptor of every point; the detector's order depends on how many there are.
std::vector<std::vector<float>> InOrder(const features::Features& features) {
  std::vector<std::vector<float>> points;
  for (int i = 0; i < features.size(); ++i) {
    const cv::KeyPoint& keypoint = features.keypoints[static_cast<std::size_t>(i)];
    points.push_back({keypoint.pt.x, keypoint.pt.y, keypoint.angle});
    const cv::Mat descriptor = features.descriptors.row(i);
    points.back().insert(points.back().end(), descriptor.begin<float>(), descriptor.end<float>());
  }
  std::sort(points.begin(), points.end());
  return points;
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
  const cv::Mat window = Gray(disturbed(cv::Rect(0, 0, 320, 240)));
  EXPECT_NEAR(ExtractStrong(window, params_, limit.Response(noisy)).size(), in_window, 0.15 * static_cast<double>(in_window));
}

TEST_F(StrengthLimitTest, IsNoneWhereTheImageKeepsAll) {
  params_.max_keypoints = 100000;
  StrengthLimit limit(image_, Found(image_, params_), params_, {320, 240});
  EXPECT_EQ(limit.Response({}), 0.0);
  EXPECT_EQ(StrengthLimit(image_, {}, params_, {320, 240}).Response({}), 0.0);
}

// What is not described first makes no difference to what is left.
TEST_F(StrengthLimitTest, StrongPointsAreThoseOfAllThatAreStrong) {
  for (const char* type : {"sift", "surf"}) {
    params_.type = type;
    const features::Features all = Found(image_, params_);
    std::vector<float> responses;
    for (const cv::KeyPoint& keypoint : all.keypoints) responses.push_back(keypoint.response);
    std::nth_element(responses.begin(), responses.begin() + all.size() / 2, responses.end());
    const float middle = responses[static_cast<std::size_t>(all.size() / 2)];
    std::vector<int> strong;
    for (int i = 0; i < all.size(); ++i) {
      if (all.keypoints[static_cast<std::size_t>(i)].response >= middle) strong.push_back(i);
    }
    EXPECT_EQ(InOrder(ExtractStrong(Gray(image_), params_, middle)), InOrder(features::Select(all, strong))) << type;
  }
}

}  // namespace
}  // namespace vantage::assessment
