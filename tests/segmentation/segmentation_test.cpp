#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>

#include "rgbd/bop.h"
#include "segmentation/clusters.h"
#include "segmentation/overlap.h"
#include "segmentation/plane.h"
#include "support/data.h"

namespace vantage::segmentation {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using geometry::PinholeCamera;
using rgbd::Frame;

// A table and upright boxes on it, seen by a camera 0.45 m above the table looking 40 degrees down.
class Tabletop {
 public:
  Tabletop() {
    frame_.camera = {320, 240, 280, 280, 159.5, 119.5};
    frame_.color = cv::Mat(240, 320, CV_8UC3, cv::Scalar(90, 90, 90));
    frame_.depth = cv::Mat(240, 320, CV_16UC1, cv::Scalar(0));
    labels_ = cv::Mat(240, 320, CV_8UC1, cv::Scalar(0));
    Paint([](const Vector3d& o, const Vector3d& d) { return d.z() < 0.0 ? -o.z() / d.z() : -1.0; }, 0);
  }

  // An upright box: `centre` on the table, in world (x away from the camera, z up); label 1, 2, ... in order.
  void AddBox(const Vector3d& centre, const Vector3d& size) {
    const Vector3d low = centre - Vector3d(size.x() / 2, size.y() / 2, 0.0), high = low + size;
    Paint(
        [&](const Vector3d& o, const Vector3d& d) {
          double enter = -1e9, leave = 1e9;
          for (int i = 0; i < 3; ++i) {
            const double a = (low(i) - o(i)) / d(i), b = (high(i) - o(i)) / d(i);
            enter = std::max(enter, std::min(a, b)), leave = std::min(leave, std::max(a, b));
          }
          return enter < leave ? enter : -1.0;
        },
        ++boxes_);
  }

  void AddNoise(double sigma_m, unsigned seed) {
    std::mt19937 generator(seed);
    std::normal_distribution<double> noise(0.0, 1000.0 * sigma_m);
    for (int y = 0; y < 240; ++y)
      for (int x = 0; x < 320; ++x) {
        std::uint16_t& depth = frame_.depth.at<std::uint16_t>(y, x);
        if (depth) depth = static_cast<std::uint16_t>(std::lround(depth + noise(generator)));
      }
  }

  Frame& frame() { return frame_; }
  const cv::Mat& labels() const { return labels_; }
  cv::Mat Mask(int label) const { return labels_ == label; }
  Vector3d up_in_camera() const { return {0.0, -std::cos(kDown), -std::sin(kDown)}; }

 private:
  static constexpr double kDown = 0.7;

  template <typename Ray>
  void Paint(const Ray& distance, int label) {
    const Vector3d eye(-0.5, 0.0, 0.45), forward(std::cos(kDown), 0, -std::sin(kDown)), right(0, -1, 0),
        down(-std::sin(kDown), 0, -std::cos(kDown));
    for (int y = 0; y < 240; ++y) {
      for (int x = 0; x < 320; ++x) {
        const Vector3d ray = frame_.camera.Unproject(Vector2d(x, y), 1.0);
        const double z = distance(eye, ray.x() * right + ray.y() * down + forward);  // Along z, as the ray's z is 1.
        std::uint16_t& depth = frame_.depth.at<std::uint16_t>(y, x);
        if (z <= 0.0 || z > 3.0 || (depth && 1000.0 * z >= depth)) continue;
        depth = static_cast<std::uint16_t>(std::lround(1000.0 * z));
        labels_.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(label);
      }
    }
  }

  Frame frame_;
  cv::Mat labels_;
  int boxes_ = 0;
};

TEST(Plane, OfANoisyTableIsRightToAMillimetreAndFacesTheCamera) {
  Tabletop table;
  table.AddBox({0.1, 0.0, 0.0}, {0.1, 0.1, 0.2});
  table.AddNoise(0.003, 1);
  const std::optional<Plane> plane = FitPlane(table.frame(), {});
  ASSERT_TRUE(plane);
  EXPECT_LT(std::acos(std::min(1.0, plane->normal.dot(table.up_in_camera()))), 0.005);
  EXPECT_NEAR(plane->offset_m, 0.45, 0.002);
  EXPECT_NEAR(plane->normal.norm(), 1.0, 1e-12);
  EXPECT_GT(plane->share, 0.6);
  EXPECT_LE(plane->share, 1.0);
}

TEST(Plane, IsTheSameOnEveryRun) {
  Tabletop table;
  table.AddNoise(0.003, 2);
  const Plane first = *FitPlane(table.frame(), {}), second = *FitPlane(table.frame(), {});
  EXPECT_EQ(first.normal, second.normal);
  EXPECT_EQ(first.offset_m, second.offset_m);
}

TEST(Plane, AWallThatFillsMoreOfTheImageIsNotTheTable) {
  Tabletop table;
  table.AddBox({0.45, 0.0, 0.0}, {0.02, 3.0, 2.0});
  PlaneParams params;
  const std::optional<Plane> plane = FitPlane(table.frame(), params);
  ASSERT_TRUE(plane);
  EXPECT_GT(plane->normal.dot(table.up_in_camera()), 0.99);
  // A wall of its own is what there is.
  Frame wall = table.frame();
  wall.depth.setTo(0, table.labels() == 0);
  const std::optional<Plane> only = FitPlane(wall, params);
  ASSERT_TRUE(only);
  EXPECT_LT(std::abs(only->normal.dot(table.up_in_camera())), 0.02);
}

TEST(Plane, NoDepthFewPointsOrNoPlaneGiveNone) {
  Tabletop table;
  Frame frame = table.frame();
  frame.depth = cv::Mat();
  EXPECT_FALSE(FitPlane(frame, {}));
  frame.depth = cv::Mat::zeros(240, 320, CV_16UC1);
  EXPECT_FALSE(FitPlane(frame, {}));
  frame.depth.at<std::uint16_t>(2, 2) = 700;
  EXPECT_FALSE(FitPlane(frame, {}));
  std::mt19937 generator(3);
  for (int y = 0; y < 240; ++y)
    for (int x = 0; x < 320; ++x) frame.depth.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(500 + generator() % 1500);
  EXPECT_FALSE(FitPlane(frame, {}));
}

TEST(Plane, CheckNamesTheField) {
  PlaneParams params;
  params.min_share = 0.0;
  try {
    params.Check();
    FAIL() << "min_share 0 passed";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("min_share"), std::string::npos) << error.what();
  }
}

TEST(Clusters, TwoBoxesOneBehindTheOtherAreTwoObjects) {
  Tabletop table;
  table.AddBox({0.0, 0.05, 0.0}, {0.06, 0.12, 0.15});
  table.AddBox({0.25, -0.05, 0.0}, {0.06, 0.12, 0.2});
  table.AddNoise(0.001, 4);
  const std::vector<Cluster> clusters = Segment(table.frame());
  ASSERT_EQ(clusters.size(), 2u);
  EXPECT_GE(clusters[0].pixels, clusters[1].pixels);
  EXPECT_GT(BestOverlap(clusters, table.Mask(1)), 0.9);
  EXPECT_GT(BestOverlap(clusters, table.Mask(2)), 0.9);
  for (const Cluster& cluster : clusters) {
    EXPECT_FALSE(cluster.touches_border);
    EXPECT_EQ(cluster.box, cv::boundingRect(cluster.mask));
    EXPECT_NEAR(cluster.centroid.norm(), 0.7, 0.25);
  }
}

TEST(Clusters, AFineGridOfHolesPartsNothingAndIsClosedInTheMask) {
  Tabletop table;
  table.AddBox({0.1, 0.0, 0.0}, {0.1, 0.15, 0.2});
  for (int y = 0; y < 240; ++y)
    for (int x = 0; x < 320; ++x)
      if (y % 4 == 0 || x % 5 < 2) table.frame().depth.at<std::uint16_t>(y, x) = 0;
  const std::vector<Cluster> clusters = Segment(table.frame());
  ASSERT_EQ(clusters.size(), 1u);
  EXPECT_GT(IntersectionOverUnion(clusters[0].mask, table.Mask(1)), 0.9);
  std::vector<std::vector<cv::Point>> outlines;
  cv::findContours(clusters[0].mask, outlines, cv::RETR_LIST, cv::CHAIN_APPROX_NONE);
  EXPECT_EQ(outlines.size(), 1u) << "the mask has holes";
}

TEST(Clusters, AHoleThroughWhichTheTableIsSeenStaysAHole) {
  Tabletop table;
  table.AddBox({0.1, 0.0, 0.0}, {0.02, 0.03, 0.15});
  table.AddBox({0.1, 0.12, 0.0}, {0.02, 0.03, 0.15});
  table.AddBox({0.1, 0.06, 0.12}, {0.02, 0.15, 0.03});  // A gate.
  const std::vector<Cluster> clusters = Segment(table.frame());
  ASSERT_EQ(clusters.size(), 1u);
  EXPECT_GT(IntersectionOverUnion(clusters[0].mask, table.labels() > 0), 0.85);
}

TEST(Clusters, WhatIsInsideAnOpenBoxBelongsToItAndWhatStandsOnTopDoesNot) {
  Tabletop table;
  table.AddBox({0.25, 0.0, 0.0}, {0.01, 0.3, 0.2});
  table.AddBox({0.15, 0.15, 0.0}, {0.2, 0.01, 0.2});
  table.AddBox({0.15, -0.15, 0.0}, {0.2, 0.01, 0.2});
  table.AddBox({0.14, 0.0, 0.0}, {0.04, 0.06, 0.12});
  const std::vector<Cluster> one = Segment(table.frame());
  ASSERT_EQ(one.size(), 1u);
  EXPECT_GT(IntersectionOverUnion(one[0].mask, table.labels() > 0), 0.85);
  ClusterParams apart;
  apart.merge_share = 2.0;
  EXPECT_EQ(Segment(table.frame(), apart).size(), 2u);

  Tabletop stacked;
  stacked.AddBox({0.05, 0.0, 0.0}, {0.2, 0.2, 0.05});
  stacked.AddBox({0.1, 0.0, 0.05}, {0.05, 0.08, 0.1});
  stacked.frame().depth.setTo(0, cv::Mat(stacked.Mask(2) ^ [&] {
                                cv::Mat wide;
                                cv::dilate(stacked.Mask(2), wide, cv::Mat(), {-1, -1}, 6);
                                return wide;
                              }()));
  const std::vector<Cluster> two = Segment(stacked.frame());
  ASSERT_EQ(two.size(), 2u);
  EXPECT_GT(BestOverlap(two, stacked.Mask(2)), 0.9);
}

TEST(Clusters, TooLargeTooSmallTooHighIsNoObjectAndTheBorderIsTold) {
  Tabletop table;
  table.AddBox({0.5, 0.0, 0.0}, {0.02, 3.0, 2.0});     // A wall.
  table.AddBox({0.0, 0.1, 0.0}, {0.01, 0.01, 0.015});  // A crumb.
  EXPECT_TRUE(Segment(table.frame()).empty());
  table.AddBox({-0.05, 0.31, 0.0}, {0.1, 0.3, 0.1});  // Partly out of the image.
  const std::vector<Cluster> clusters = Segment(table.frame());
  ASSERT_EQ(clusters.size(), 1u);
  EXPECT_TRUE(clusters[0].touches_border);
}

TEST(Clusters, AreFoundByPixelAndNearTheCentre) {
  Tabletop table;
  table.AddBox({0.1, 0.0, 0.0}, {0.06, 0.08, 0.1});
  table.AddBox({0.1, 0.25, 0.0}, {0.06, 0.12, 0.2});
  const std::vector<Cluster> clusters = Segment(table.frame());
  ASSERT_EQ(clusters.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    const cv::Point middle = (clusters[i].box.tl() + clusters[i].box.br()) / 2;
    EXPECT_EQ(ClusterAt(clusters, Vector2d(middle.x, middle.y)), static_cast<int>(i));
    EXPECT_EQ(ClusterAt(clusters, Vector2d(middle.x, clusters[i].box.br().y + 5)), static_cast<int>(i));
  }
  EXPECT_EQ(ClusterAt(clusters, Vector2d(310, 235)), -1);
  EXPECT_EQ(ClusterNearestCentre(clusters), 1) << "the small box stands in the middle";
  EXPECT_EQ(ClusterNearestCentre({}), -1);
  EXPECT_EQ(ClusterAt({}, Vector2d(1, 1)), -1);
}

TEST(Clusters, CheckNamesTheField) {
  ClusterParams params;
  params.max_height_m = 0.001;
  try {
    params.Check();
    FAIL() << "a largest height below the least passed";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("max_height_m"), std::string::npos) << error.what();
  }
}

TEST(RealData, OsdObjectsThatStandApartAreFoundWhole) {
  VANTAGE_NEEDS_DATA("osd");
  const rgbd::BopScene scene(testing::DataFolder() / "osd");
  int objects = 0, found = 0;
  for (const int id : rgbd::SelectFrames(scene.ids(), "0:17")) {
    const std::vector<Cluster> clusters = Segment(scene.Load(id));
    const cv::Mat label = scene.LoadLabel(id);
    for (int object = 2; object < 26; ++object) {
      const cv::Mat mask = (label >= 10 * object) & (label < 10 * object + 10);
      if (cv::countNonZero(mask) < 300) continue;
      ++objects;
      found += BestOverlap(clusters, mask) >= 0.9;
    }
  }
  EXPECT_EQ(objects, 38);
  EXPECT_EQ(found, 38);
}

TEST(RealData, BoardObjectsAreFoundWholeAndNothingElse) {
  VANTAGE_NEEDS_DATA("board");
  const rgbd::BopScene scene(testing::DataFolder() / "board");
  for (std::size_t i = 0; i < scene.ids().size(); i += 12) {
    const int id = scene.ids()[i];
    const std::vector<Cluster> clusters = Segment(scene.Load(id));
    const cv::Mat label = scene.LoadLabel(id);
    int objects = 0;
    for (const int object : {1, 2}) {
      const cv::Mat mask = label == object;
      if (cv::countNonZero(mask) < 1000) continue;
      ++objects;
      EXPECT_GT(BestOverlap(clusters, mask), 0.9) << "frame " << id << " label " << object;
    }
    EXPECT_LE(clusters.size(), 2u) << "frame " << id;
    EXPECT_GE(static_cast<int>(clusters.size()), objects);
  }
}

TEST(RealData, YcbvBoxAndFoamAreFoundOnADesk) {
  VANTAGE_NEEDS_DATA("ycbv");
  const rgbd::BopScene scene(testing::DataFolder() / "ycbv");
  const std::vector<Cluster> clusters = Segment(scene.Load(3));
  const cv::Mat label = scene.LoadLabel(3);
  for (const int object : {8, 14, 21}) EXPECT_GT(BestOverlap(clusters, label == object), 0.8) << "label " << object;
}

TEST(RealData, ShelfBoxCartonsInsideIsOnePieceInTheFirstFrame) {
  VANTAGE_NEEDS_DATA("shelf_box");
  const rgbd::BopScene scene(testing::DataFolder() / "shelf_box");
  const Frame frame = scene.Load(scene.ids().front());
  const std::vector<Cluster> clusters = Segment(frame);
  const int target = ClusterAt(clusters, Vector2d(430, 150));  // The yellow book leaning on the right wall.
  ASSERT_GE(target, 0);
  const Cluster& carton = clusters[target];
  EXPECT_GT(carton.pixels, 15000);
  EXPECT_NEAR(carton.centroid.z(), 0.54, 0.1);
  EXPECT_EQ(carton.mask.at<std::uint8_t>(210, 560), 0) << "the packet behind the carton is not part of it";
  EXPECT_EQ(carton.mask.at<std::uint8_t>(420, 400), 0) << "nor is the table";
}

}  // namespace
}  // namespace vantage::segmentation
