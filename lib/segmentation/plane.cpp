#include "segmentation/plane.h"

#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/sample_consensus/ransac.h>
#include <pcl/sample_consensus/sac_model_plane.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>

namespace vantage::segmentation {
namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;

constexpr int kMaxPlanes = 4;  // Looked at before a table is chosen.
constexpr int kRefinements = 4;
constexpr double kFloor_m = 0.4;  // A plane so far under another is the floor, and the other the table.

void Require(bool ok, const char* what, double found) {
  if (!ok) throw std::invalid_argument(std::string("plane: ") + what + ", is " + std::to_string(found));
}

// The frame's points on a grid of every n-th pixel, up to the depth limit.
Cloud::Ptr SparsePoints(const rgbd::Frame& frame, const PlaneParams& params) {
  auto cloud = std::make_shared<Cloud>();
  for (int y = params.step_px / 2; y < frame.depth.rows; y += params.step_px) {
    for (int x = params.step_px / 2; x < frame.depth.cols; x += params.step_px) {
      // The nearest measured pixel of the cell: a fine grid of holes in step with ours must not hide the whole surface.
      for (int shift = 0; shift < params.step_px && x + shift < frame.depth.cols; ++shift) {
        const double z = 0.001 * frame.depth.at<std::uint16_t>(y, x + shift);
        if (z <= 0.0) continue;
        if (z > params.max_depth_m) break;
        const Eigen::Vector3d point = frame.camera.Unproject(Eigen::Vector2d(x + shift, y), z);
        cloud->emplace_back(static_cast<float>(point.x()), static_cast<float>(point.y()), static_cast<float>(point.z()));
        break;
      }
    }
  }
  return cloud;
}

Eigen::Vector3d At(const Cloud& cloud, std::size_t index) { return cloud[index].getVector3fMap().cast<double>(); }

// Least squares on the points within the band, a few times over: RANSAC's plane goes through three noisy points.
Plane Refine(const Cloud& cloud, const pcl::Indices& among, Plane plane, double max_distance_m) {
  for (int i = 0; i < kRefinements; ++i) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
    int count = 0;
    for (const int index : among) {
      const Eigen::Vector3d point = At(cloud, index);
      if (std::abs(plane.Height(point)) > max_distance_m) continue;
      mean += point;
      moments += point * point.transpose();
      ++count;
    }
    if (count < 3) break;
    mean /= count;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(moments / count - mean * mean.transpose());
    plane.normal = solver.eigenvectors().col(0);
    plane.offset_m = -plane.normal.dot(mean);
  }
  if (plane.offset_m < 0.0) {  // The camera is the origin, so its height is the offset.
    plane.normal = -plane.normal;
    plane.offset_m = -plane.offset_m;
  }
  return plane;
}

// Over how much the points spread across their longest direction, metres.
double Breadth(const Cloud& cloud, const pcl::Indices& among) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  for (const int index : among) {
    const Eigen::Vector3d point = At(cloud, index);
    mean += point;
    moments += point * point.transpose();
  }
  const double count = static_cast<double>(std::max<std::size_t>(1, among.size()));
  mean /= count;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(moments / count - mean * mean.transpose());
  return std::sqrt(12.0 * std::max(0.0, solver.eigenvalues()(1)));
}

// The table that stands on `floor`: the largest level plane far enough above it; nullopt where there is none.
std::optional<Plane> TableOver(const Cloud& cloud, const pcl::Indices& among, const Plane& floor, const PlaneParams& params) {
  std::map<int, int> layers;  // Points by height in bands of max_distance_m.
  for (const int index : among)
    if (const double height_m = floor.Height(At(cloud, index)); height_m >= kFloor_m)
      ++layers[static_cast<int>(height_m / params.max_distance_m)];
  int thickest = -1, most = 0;  // Two neighbouring bands: the table may lie on their border.
  for (const auto& [layer, count] : layers) {
    const auto next = layers.find(layer + 1);
    const int both = count + (next == layers.end() ? 0 : next->second);
    if (both > most) most = both, thickest = layer;
  }
  if (most < params.min_share * static_cast<double>(cloud.size())) return std::nullopt;
  Plane table = floor;
  table.offset_m -= (thickest + 1) * params.max_distance_m;
  table = Refine(cloud, among, table, params.max_distance_m);
  pcl::Indices on;
  for (const int index : among)
    if (std::abs(table.Height(At(cloud, index))) <= params.max_distance_m) on.push_back(index);
  table.share = static_cast<double>(on.size()) / static_cast<double>(cloud.size());
  if (table.share < params.min_share || Breadth(cloud, on) < params.min_size_m) return std::nullopt;
  return table;
}

// The plane with most support among the given points; nullopt where RANSAC finds none.
std::optional<Plane> LargestPlane(const Cloud::Ptr& cloud, const pcl::Indices& among, const PlaneParams& params) {
  if (among.size() < 3) return std::nullopt;
  const auto model = std::make_shared<pcl::SampleConsensusModelPlane<pcl::PointXYZ>>(cloud, among);  // Its seed is fixed.
  pcl::RandomSampleConsensus<pcl::PointXYZ> ransac(model, params.max_distance_m);
  ransac.setMaxIterations(params.max_iterations);
  ransac.setProbability(params.confidence);
  if (!ransac.computeModel()) return std::nullopt;
  Eigen::VectorXf coefficients;
  ransac.getModelCoefficients(coefficients);
  Plane plane;
  plane.normal = coefficients.head<3>().cast<double>();
  plane.offset_m = coefficients(3) / plane.normal.norm();
  plane.normal.normalize();
  return Refine(*cloud, among, plane, params.max_distance_m);
}

}  // namespace

void PlaneParams::Check() const {
  Require(std::isfinite(max_distance_m) && max_distance_m > 0.0, "max_distance_m must be > 0", max_distance_m);
  Require(confidence > 0.0 && confidence < 1.0, "confidence must be in (0, 1)", confidence);
  Require(max_iterations >= 1, "max_iterations must be >= 1", max_iterations);
  Require(step_px >= 1, "step_px must be >= 1", step_px);
  Require(min_share > 0.0 && min_share <= 1.0, "min_share must be in (0, 1]", min_share);
  Require(std::isfinite(min_size_m) && min_size_m >= 0.0, "min_size_m must be >= 0", min_size_m);
  Require(min_up >= -1.0 && min_up <= 1.0, "min_up must be in [-1, 1]", min_up);
  Require(max_depth_m > 0.0, "max_depth_m must be > 0", max_depth_m);
}

std::optional<Plane> FitPlane(const rgbd::Frame& frame, const PlaneParams& params) {
  params.Check();
  if (frame.depth.empty()) return std::nullopt;
  const Cloud::Ptr cloud = SparsePoints(frame, params);
  pcl::Indices left(cloud->size());
  std::iota(left.begin(), left.end(), 0);
  std::optional<Plane> largest;
  for (int i = 0; i < kMaxPlanes; ++i) {
    std::optional<Plane> plane = LargestPlane(cloud, left, params);
    if (!plane) break;
    pcl::Indices on, off;
    for (const int index : left) (std::abs(plane->Height(At(*cloud, index))) > params.max_distance_m ? off : on).push_back(index);
    plane->share = static_cast<double>(on.size()) / static_cast<double>(cloud->size());
    if (plane->share < params.min_share) break;
    left = std::move(off);
    if (Breadth(*cloud, on) < params.min_size_m) continue;
    if (-plane->normal.y() >= params.min_up) return TableOver(*cloud, left, *plane, params).value_or(*plane);
    if (!largest) largest = plane;
  }
  return largest;
}

}  // namespace vantage::segmentation
