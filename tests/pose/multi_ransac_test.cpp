#include "pose/multi_ransac.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "pose/support.h"

namespace vantage::pose {
namespace {

// Clusters of objects at known poses, the first share of each one's matches right; then one of outliers only.
struct Table {
  std::vector<geometry::Rigid> T_camera_object;
  std::vector<MatchCluster> clusters;
};

Table MakeTable(std::uint32_t seed, int objects, int matches, double inlier_share) {
  Truth truth(seed);
  Table table;
  for (int i = 0; i < objects; ++i) {
    table.T_camera_object.push_back(truth.Pose());
    table.clusters.push_back({truth.Matches(table.T_camera_object.back(), matches, inlier_share, 1.0), {}, 7});
  }
  table.clusters.push_back({truth.Matches(truth.Pose(), matches, 0.0, 1.0), {}, 7});
  return table;
}

double ErrorOf(const std::optional<PoseEstimate>& estimate, const geometry::Rigid& T) {
  return estimate ? geometry::Difference(estimate->T_camera_object, T).translation_m : 1e9;
}

TEST(MultiRansac, FindsEveryObjectAndNothingAmongOutliers) {
  const Table table = MakeTable(1, 12, 40, 0.5);
  const MultiPose found = EstimatePoses(table.clusters, kCamera, nullptr, RansacParams{}, 0);
  ASSERT_EQ(found.poses.size(), 13u);
  for (int i = 0; i < 12; ++i) EXPECT_LT(ErrorOf(found.poses[i], table.T_camera_object[i]), 0.02) << i;
  EXPECT_FALSE(found.poses[12].has_value());
  EXPECT_EQ(found.matched, 13 * 40);
  EXPECT_NEAR(found.explained, 12 * 20, 12);
}

// Equation (8): the share is that of the whole image, and the loop ends with it although the cluster of outliers explains nothing.
TEST(MultiRansac, EndsWhenTheImageIsExplained) {
  const Table table = MakeTable(2, 6, 50, 0.6);
  RansacParams params;
  params.min_iterations = params.min_joint_iterations = 1;
  const MultiPose found = EstimatePoses(table.clusters, kCamera, nullptr, params, 0);
  const double share = double(found.explained) / found.matched;
  const double needed = std::log(params.failure_rate) / std::log(1.0 - share * share * share);
  EXPECT_NEAR(found.iterations, needed, 0.2 * needed + 1);
  EXPECT_FALSE(found.poses[6].has_value());
}

TEST(MultiRansac, AClusterThatIsExplainedStopsAndOthersGoOn) {
  Truth truth(3);
  const geometry::Rigid easy = truth.Pose(), hard = truth.Pose();
  const std::vector<MatchCluster> clusters = {{truth.Matches(easy, 30, 1.0, 0.5), {}, 7},
                                              {truth.Matches(hard, 200, 0.15, 0.5), {}, 7}};
  const MultiPose found = EstimatePoses(clusters, kCamera, nullptr, RansacParams{}, 0);
  EXPECT_LT(ErrorOf(found.poses[0], easy), 0.01);
  EXPECT_LT(ErrorOf(found.poses[1], hard), 0.02);
  EXPECT_EQ(found.poses[0]->iterations, RansacParams{}.min_iterations);
  EXPECT_GT(found.poses[1]->iterations, 300);
}

// A hidden object's cluster holds few right matches: without patience it is given up once the others are explained.
TEST(MultiRansac, AHiddenObjectIsFoundAmongOthersThatAreClear) {
  Truth truth(9);
  std::vector<MatchCluster> clusters;
  for (int i = 0; i < 10; ++i) clusters.push_back({truth.Matches(truth.Pose(), 80, 0.95, 0.5), {}, 7});
  const geometry::Rigid hidden = truth.Pose();
  clusters.push_back({truth.Matches(hidden, 100, 0.25, 0.5), {}, 7});
  RansacParams params;
  EXPECT_LT(ErrorOf(EstimatePoses(clusters, kCamera, nullptr, params, 0).poses[10], hidden), 0.02);
  params.min_iterations = params.min_joint_iterations = 1;
  EXPECT_FALSE(EstimatePoses(clusters, kCamera, nullptr, params, 0).poses[10].has_value());
}

TEST(MultiRansac, ClustersThatCanNeverBeAcceptedCostNothing) {
  Truth truth(4);
  std::vector<MatchCluster> clusters(50, {truth.Matches(truth.Pose(), 6, 0.0, 0.5), {}, 7});
  const MultiPose none = EstimatePoses(clusters, kCamera, nullptr, RansacParams{}, 0);
  EXPECT_EQ(none.iterations, 0);
  EXPECT_EQ(none.matched, 0);
  clusters.push_back({truth.Matches(truth.Pose(), 20, 0.9, 0.5), {}, 7});
  const MultiPose one = EstimatePoses(clusters, kCamera, nullptr, RansacParams{}, 0);
  EXPECT_EQ(one.matched, 20);
  EXPECT_TRUE(one.poses[50].has_value());
}

TEST(MultiRansac, OrderOfTheClustersDoesNotMatter) {
  Table table = MakeTable(5, 5, 60, 0.35);
  const MultiPose forward = EstimatePoses(table.clusters, kCamera, nullptr, RansacParams{}, 9);
  std::reverse(table.clusters.begin(), table.clusters.end());
  const MultiPose backward = EstimatePoses(table.clusters, kCamera, nullptr, RansacParams{}, 9);
  EXPECT_EQ(forward.iterations, backward.iterations);
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(forward.poses[i] && backward.poses[5 - i]) << i;
    EXPECT_EQ(forward.poses[i]->T_camera_object.matrix(), backward.poses[5 - i]->T_camera_object.matrix()) << i;
  }
}

TEST(MultiRansac, AnInterestPointCountsOnceHoweverManyMatchesItHas) {
  Truth truth(6);
  MatchCluster cluster{truth.Matches(truth.Pose(), 20, 1.0, 0.5), {}, 7};
  for (int i = 0; i < 20; ++i) cluster.keypoints.push_back(i / 2);
  const MultiPose found = EstimatePoses({cluster, cluster}, kCamera, nullptr, RansacParams{}, 0);
  EXPECT_EQ(found.matched, 10);
  EXPECT_EQ(found.explained, 10);
}

TEST(MultiRansac, MinInliersIsKept) {
  Truth truth(7);
  const auto matches = truth.Matches(truth.Pose(), 30, 0.3, 0.2);
  EXPECT_TRUE(EstimatePoses({{matches, {}, 8}}, kCamera, nullptr, RansacParams{}, 0).poses[0].has_value());
  EXPECT_FALSE(EstimatePoses({{matches, {}, 14}}, kCamera, nullptr, RansacParams{}, 0).poses[0].has_value());
}

TEST(MultiRansac, MalformedClustersAreRefused) {
  Truth truth(8);
  MatchCluster cluster{truth.Matches(truth.Pose(), 20, 1.0, 0.5), {1, 2}, 7};
  EXPECT_THROW(EstimatePoses({cluster}, kCamera, nullptr, RansacParams{}, 0), std::invalid_argument);
  cluster.keypoints.clear();
  cluster.min_inliers = 3;
  EXPECT_THROW(EstimatePoses({cluster}, kCamera, nullptr, RansacParams{}, 0), std::invalid_argument);
  EXPECT_TRUE(EstimatePoses({}, kCamera, nullptr, RansacParams{}, 0).poses.empty());
}

}  // namespace
}  // namespace vantage::pose
