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

// Every vote climbs for itself: the mode it comes to, without any of what makes MeanShift quick.
Eigen::Vector2d Climb(const std::vector<Vote>& votes, Eigen::Vector2d mode, double bandwidth) {
  for (int step = 0; step < 100; ++step) {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double weight = 0.0;
    for (const Vote& vote : votes) {
      if ((vote.centre - mode).norm() > bandwidth * vote.radius_px) continue;
      sum += vote.weight * vote.centre;
      weight += vote.weight;
    }
    const Eigen::Vector2d next = sum / weight;
    if ((next - mode).norm() < 1e-9) break;
    mode = next;
  }
  return mode;
}

TEST(MeanShift, EveryVoteIsInTheClusterOfTheModeItClimbsTo) {
  std::mt19937 random(3);
  const auto uniform = [&](double low, double high) { return low + (high - low) * (random() / 4294967296.0); };
  std::vector<Vote> votes;
  for (const double x : {200.0, 420.0, 700.0}) {
    for (int i = 0; i < 50; ++i) {
      const double radius_px = uniform(40, 70);
      votes.push_back({{x + uniform(-30, 30), 300 + uniform(-30, 30)}, radius_px, uniform(0.5, 1.5)});
    }
  }
  for (const VoteCluster& cluster : MeanShift(votes, 0.5)) {
    for (const int vote : cluster.votes) {
      const Vote& member = votes[static_cast<std::size_t>(vote)];
      EXPECT_LT((Climb(votes, member.centre, 0.5) - cluster.centre).norm(), 0.25 * member.radius_px + 0.5) << vote;
    }
  }
}

}  // namespace
}  // namespace vantage::recognition
