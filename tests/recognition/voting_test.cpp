#include "recognition/voting.h"

#include <gtest/gtest.h>

#include <random>

namespace vantage::recognition {
namespace {

cv::KeyPoint Keypoint(double x, double y, double size, double angle) {
  return cv::KeyPoint(static_cast<float>(x), static_cast<float>(y), static_cast<float>(size), static_cast<float>(angle));
}

// The learned view turned by 90 degrees, doubled and moved: the vote must land on the moved centre.
TEST(CastVote, FollowsScaleRotationAndPlace) {
  const cv::KeyPoint model = Keypoint(100, 100, 4, 10);
  const Eigen::Vector2d centre_from_keypoint(30, 0);  // The object's centre is at (130, 100).
  const cv::KeyPoint query = Keypoint(300, 200, 8, 100);
  const Vote vote = CastVote(query, model, centre_from_keypoint, 50);
  EXPECT_NEAR(vote.centre.x(), 300, 1e-4);
  EXPECT_NEAR(vote.centre.y(), 260, 1e-4);  // +90 degrees in an image whose y points down.
  EXPECT_NEAR(vote.radius_px, 100, 1e-6);
}

TEST(MeanShift, GathersTheVotesOfOneObjectAndRanksIt) {
  std::mt19937 random(1);
  const auto uniform = [&](double low, double high) { return low + (high - low) * (random() / 4294967296.0); };
  std::vector<Vote> votes;
  for (int i = 0; i < 40; ++i) votes.push_back({{uniform(390, 410), uniform(290, 310)}, 60, 1});
  for (int i = 0; i < 60; ++i) votes.push_back({{uniform(0, 1280), uniform(0, 720)}, 60, 1});
  const auto clusters = MeanShift(votes, 0.5);
  ASSERT_FALSE(clusters.empty());
  EXPECT_NEAR((clusters[0].centre - Eigen::Vector2d(400, 300)).norm(), 0, 10);
  int of_object = 0;
  for (const int vote : clusters[0].votes) of_object += vote < 40;
  EXPECT_GE(of_object, 39);
  size_t total = 0;
  for (size_t i = 0; i < clusters.size(); ++i) {
    total += clusters[i].votes.size();
    if (i > 0) {
      EXPECT_LE(clusters[i].weight, clusters[i - 1].weight);
    }
  }
  EXPECT_EQ(total, votes.size());
  EXPECT_TRUE(MeanShift({}, 0.5).empty());
}

}  // namespace
}  // namespace vantage::recognition
