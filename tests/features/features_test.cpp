#include "features/features.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>

namespace vantage::features {
namespace {

cv::Mat RandomUnitRows(int rows, int columns, std::uint32_t seed) {
  std::mt19937 random(seed);
  cv::Mat matrix(rows, columns, CV_32F);
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) matrix.at<float>(r, c) = random() / 4294967296.f;
    matrix.row(r) /= cv::norm(matrix.row(r));
  }
  return matrix;
}

// Blobs of random size and place on grey: something with interest points.
cv::Mat Blobs(std::uint32_t seed) {
  std::mt19937 random(seed);
  cv::Mat image(240, 320, CV_8UC1, cv::Scalar(128));
  for (int i = 0; i < 150; ++i) {
    cv::circle(image, cv::Point(random() % 320, random() % 240), 2 + random() % 9, cv::Scalar(random() % 256), cv::FILLED,
               cv::LINE_AA);
  }
  return image;
}

// Rows and groups of every odd size against the definition.
TEST(NearestTwo, AgreesWithTheDefinition) {
  for (const int train_rows : {1, 2, 5, 33}) {
    for (const bool grouped : {false, true}) {
      const cv::Mat query = RandomUnitRows(19, 31, 1), train = RandomUnitRows(train_rows, 31, 2);
      std::vector<int> groups;
      if (grouped) {
        for (int r = 0; r < train_rows; ++r) groups.push_back(r / 3);
      }
      const auto pairs = NearestTwo(query, train, groups);
      ASSERT_EQ(pairs.size(), 19u);
      for (int q = 0; q < query.rows; ++q) {
        int best = 0, second = -1;
        const auto distance = [&](int r) { return cv::norm(query.row(q), train.row(r)); };
        for (int r = 1; r < train_rows; ++r) best = distance(r) < distance(best) ? r : best;
        for (int r = 0; r < train_rows; ++r) {
          if (r == best || (grouped && groups[r] == groups[best])) continue;
          if (second < 0 || distance(r) < distance(second)) second = r;
        }
        EXPECT_EQ(pairs[q].best, best);
        EXPECT_EQ(pairs[q].second, second);
        EXPECT_NEAR(pairs[q].best_distance, distance(best), 1e-3);
        if (second >= 0) {
          EXPECT_NEAR(pairs[q].second_distance, distance(second), 1e-3);
        }
      }
    }
  }
}

TEST(NearestTwo, NothingToMatchIsNoMatch) {
  EXPECT_TRUE(NearestTwo(cv::Mat(0, 128, CV_32F), RandomUnitRows(3, 128, 1)).empty());
  EXPECT_EQ(NearestTwo(RandomUnitRows(2, 128, 1), cv::Mat(0, 128, CV_32F))[0].best, -1);
  EXPECT_THROW(NearestTwo(RandomUnitRows(2, 128, 1), RandomUnitRows(2, 64, 1)), std::invalid_argument);
}

TEST(Extract, AMovedImageMovesItsPointsAndKeepsTheirDescriptors) {
  const cv::Mat image = Blobs(3);
  cv::Mat moved(image.size(), CV_8UC1, cv::Scalar(128));
  image(cv::Rect(0, 0, 300, 225)).copyTo(moved(cv::Rect(20, 15, 300, 225)));
  const Features a = Extract(image, {}, {}), b = Extract(moved, {}, {});
  ASSERT_GT(a.size(), 50);
  int moved_right = 0;
  const auto matches = MatchRatio(a.descriptors, b.descriptors, 0.8);
  for (const Match& match : matches) {
    const cv::Point2f shift = b.keypoints[match.train].pt - a.keypoints[match.query].pt;
    moved_right += std::abs(shift.x - 20) < 1 && std::abs(shift.y - 15) < 1;
  }
  EXPECT_GT(matches.size(), 30u);
  EXPECT_GT(moved_right, 0.95 * matches.size());
}

TEST(Extract, TheMaskRestrictsThePointsInImageCoordinates) {
  const cv::Mat image = Blobs(4);
  cv::Mat mask = cv::Mat::zeros(image.size(), CV_8UC1);
  const cv::Rect area(150, 80, 90, 70);
  mask(area).setTo(255);
  const Features masked = Extract(image, mask, {});
  ASSERT_GT(masked.size(), 5);
  for (const cv::KeyPoint& keypoint : masked.keypoints) EXPECT_TRUE(area.contains(keypoint.pt)) << keypoint.pt;
  EXPECT_EQ(Extract(image, cv::Mat::zeros(image.size(), CV_8UC1), {}).size(), 0);
}

TEST(Extract, FlatAndWrongImages) {
  EXPECT_EQ(Extract(cv::Mat::zeros(100, 100, CV_8UC1), {}, {}).size(), 0);
  EXPECT_THROW(Extract(cv::Mat(), {}, {}), std::invalid_argument);
  EXPECT_THROW(Extract(cv::Mat::zeros(10, 10, CV_8UC3), {}, {}), std::invalid_argument);
  FeatureParams params;
  params.type = "surf";
  EXPECT_THROW(params.Check(), std::invalid_argument);
}

}  // namespace
}  // namespace vantage::features
