#include "features/features.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core/utility.hpp>
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

FeatureParams OfType(const std::string& type) {
  FeatureParams params;
  params.type = type;
  return params;
}

class ExtractOf : public ::testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Types, ExtractOf, ::testing::Values("sift", "surf"), [](const auto& type) { return type.param; });

TEST_P(ExtractOf, AMovedImageMovesItsPointsAndKeepsTheirDescriptors) {
  const cv::Mat image = Blobs(3);
  cv::Mat moved(image.size(), CV_8UC1, cv::Scalar(128));
  image(cv::Rect(0, 0, 300, 225)).copyTo(moved(cv::Rect(20, 15, 300, 225)));
  const Features a = Extract(image, {}, OfType(GetParam())), b = Extract(moved, {}, OfType(GetParam()));
  ASSERT_GT(a.size(), 50);
  int moved_right = 0;
  const auto matches = MatchRatio(a.descriptors, b.descriptors, 0.8);
  for (const Match& match : matches) {
    const cv::Point2f shift = b.keypoints[match.train].pt - a.keypoints[match.query].pt;
    moved_right += std::abs(shift.x - 20) < 1 && std::abs(shift.y - 15) < 1;
  }
  EXPECT_GT(matches.size(), 30u);
  EXPECT_GT(moved_right, 0.9 * matches.size());
}

// Half as large and turned by 30 degrees: sizes halve, angles turn the same way, for votes rely on both.
TEST_P(ExtractOf, SizesAndAnglesFollowTheImage) {
  cv::Mat image;
  cv::resize(Blobs(6), image, cv::Size(), 3, 3, cv::INTER_CUBIC);
  const cv::Point2f centre(image.cols / 2.f, image.rows / 2.f);
  const cv::Mat warp = cv::getRotationMatrix2D(centre, 30.0, 0.5);
  cv::Mat turned;
  cv::warpAffine(image, turned, warp, image.size(), cv::INTER_AREA, cv::BORDER_CONSTANT, 128);
  const Features a = Extract(image, {}, OfType(GetParam())), b = Extract(turned, {}, OfType(GetParam()));
  int matches = 0, right = 0;
  for (const Match& match : MatchRatio(a.descriptors, b.descriptors, 0.8)) {
    const cv::KeyPoint &from = a.keypoints[match.query], &to = b.keypoints[match.train];
    const cv::Mat at = warp * (cv::Mat_<double>(3, 1) << from.pt.x, from.pt.y, 1.0);
    if (std::hypot(at.at<double>(0) - to.pt.x, at.at<double>(1) - to.pt.y) > 2.0) continue;
    ++matches;
    const double turn = std::remainder(to.angle - from.angle + 30.0, 360.0);  // OpenCV turns images against the clock.
    right += std::abs(turn) < 15.0 && to.size / from.size > 0.4 && to.size / from.size < 0.63;
  }
  EXPECT_GT(matches, 30);
  EXPECT_GT(right, 0.9 * matches);
}

TEST_P(ExtractOf, TheMaskRestrictsThePointsInImageCoordinates) {
  const cv::Mat image = Blobs(4);
  cv::Mat mask = cv::Mat::zeros(image.size(), CV_8UC1);
  const cv::Rect area(150, 80, 90, 70);
  mask(area).setTo(255);
  const Features whole = Extract(image, {}, OfType(GetParam())), masked = Extract(image, mask, OfType(GetParam()));
  ASSERT_GT(masked.size(), 5);
  int of_whole = 0;
  for (const cv::KeyPoint& keypoint : masked.keypoints) {
    EXPECT_TRUE(area.contains(keypoint.pt)) << keypoint.pt;
    of_whole += std::any_of(whole.keypoints.begin(), whole.keypoints.end(),
                            [&](const cv::KeyPoint& other) { return cv::norm(other.pt - keypoint.pt) < 0.5; });
  }
  EXPECT_GT(of_whole, 0.8 * masked.size());
  EXPECT_EQ(Extract(image, cv::Mat::zeros(image.size(), CV_8UC1), OfType(GetParam())).size(), 0);
}

// What a caller that looks into a region of interest turns: fainter points, or fewer of them.
TEST_P(ExtractOf, TheThresholdSaysHowFaintPointsMayBeAndTheStrongestAreKept) {
  cv::Mat faint;
  Blobs(8).convertTo(faint, CV_8UC1, 0.1, 115.0);
  FeatureParams params = OfType(GetParam());
  const int few = Extract(faint, {}, params).size();
  params.contrast_threshold /= 5.0;
  const Features many = Extract(faint, {}, params);
  EXPECT_GT(many.size(), few + 30);
  params.max_keypoints = 20;
  const Features strongest = Extract(faint, {}, params);
  ASSERT_GE(strongest.size(), 20);
  ASSERT_LE(strongest.size(), 22);  // SIFT keeps equals.
  std::vector<float> responses;
  for (const cv::KeyPoint& keypoint : many.keypoints) responses.push_back(keypoint.response);
  std::sort(responses.rbegin(), responses.rend());
  for (const cv::KeyPoint& keypoint : strongest.keypoints) EXPECT_GE(keypoint.response, responses[19]) << keypoint.pt;
}

TEST_P(ExtractOf, IsTheSameOnOneThreadAndOfUnitLength) {
  const Features many = Extract(Blobs(7), {}, OfType(GetParam()));
  const int threads = cv::getNumThreads();
  cv::setNumThreads(1);
  const Features one = Extract(Blobs(7), {}, OfType(GetParam()));
  cv::setNumThreads(threads);
  ASSERT_EQ(many.size(), one.size());
  EXPECT_EQ(cv::norm(many.descriptors, one.descriptors, cv::NORM_INF), 0.0);
  for (int k = 0; k < many.size(); ++k) {
    EXPECT_EQ(many.keypoints[k].pt, one.keypoints[k].pt);
    EXPECT_NEAR(cv::norm(many.descriptors.row(k)), 1.0, 1e-3);
  }
}

TEST_P(ExtractOf, FlatAndWrongImages) {
  const FeatureParams params = OfType(GetParam());
  EXPECT_EQ(Extract(cv::Mat::zeros(100, 100, CV_8UC1), {}, params).size(), 0);
  EXPECT_EQ(Extract(cv::Mat(1, 3, CV_8UC1, cv::Scalar(7)), {}, params).size(), 0);
  EXPECT_THROW(Extract(cv::Mat(), {}, params), std::invalid_argument);
  EXPECT_THROW(Extract(cv::Mat::zeros(10, 10, CV_8UC3), {}, params), std::invalid_argument);
}

TEST(FeatureParams, NamesWhatIsWrongAndToldApart) {
  EXPECT_THROW(OfType("orb").Check(), std::invalid_argument);
  FeatureParams params;
  params.contrast_threshold = 0.0;
  EXPECT_THROW(params.Check(), std::invalid_argument);
  EXPECT_NE(OfType("sift").Fingerprint(), OfType("surf").Fingerprint());
}

}  // namespace
}  // namespace vantage::features
