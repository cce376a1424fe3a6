#include "segmentation/parts.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <utility>

namespace vantage::segmentation {
namespace {

constexpr std::size_t kSideSamples = 3000;

}  // namespace

Eigen::Vector3d Centroid(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) sum += point;
  return sum / static_cast<double>(points.size());
}

double LongestSide(const std::vector<Eigen::Vector3d>& points) {
  const std::size_t stride = 1 + points.size() / kSideSamples;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  double count = 0.0;
  for (std::size_t i = 0; i < points.size(); i += stride, count += 1.0) {
    mean += points[i];
    moments += points[i] * points[i].transpose();
  }
  mean /= count;
  const Eigen::Matrix3d axes =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(moments / count - mean * mean.transpose()).eigenvectors();
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e9), high = -low;
  for (std::size_t i = 0; i < points.size(); i += stride) {
    const Eigen::Vector3d along = axes.transpose() * points[i];
    low = low.cwiseMin(along), high = high.cwiseMax(along);
  }
  return (high - low).maxCoeff();
}

namespace {

double TopOf(std::vector<float> heights_m) {
  const auto nth = heights_m.begin() + static_cast<std::ptrdiff_t>(0.98 * static_cast<double>(heights_m.size() - 1));
  std::nth_element(heights_m.begin(), nth, heights_m.end());
  return *nth;
}

}  // namespace

Part MakePart(std::vector<cv::Point> pixels, std::vector<Eigen::Vector3d> points, const Plane& plane) {
  Part part;
  part.pixels = std::move(pixels);
  part.points = std::move(points);
  const Eigen::Vector3d u = plane.normal.unitOrthogonal(), v = plane.normal.cross(u);
  part.low_m = 1e9, part.high_m = -1e9;
  for (const Eigen::Vector3d& point : part.points) {
    const double height_m = plane.Height(point);
    part.footprint_cm.emplace_back(static_cast<float>(100.0 * u.dot(point)), static_cast<float>(100.0 * v.dot(point)));
    part.heights_m.push_back(static_cast<float>(height_m));
    part.low_m = std::min(part.low_m, height_m);
    part.high_m = std::max(part.high_m, height_m);
  }
  part.top_m = TopOf(part.heights_m);
  cv::convexHull(part.footprint_cm, part.hull_cm);
  return part;
}

Part Join(const Part& a, const Part& b) {
  Part both = a;
  const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
  append(both.pixels, b.pixels);
  append(both.surfaces, b.surfaces);
  append(both.points, b.points);
  append(both.footprint_cm, b.footprint_cm);
  append(both.heights_m, b.heights_m);
  std::vector<cv::Point2f> corners = a.hull_cm;
  append(corners, b.hull_cm);
  cv::convexHull(corners, both.hull_cm);
  both.low_m = std::min(a.low_m, b.low_m);
  both.high_m = std::max(a.high_m, b.high_m);
  both.top_m = TopOf(both.heights_m);
  return both;
}

}  // namespace vantage::segmentation
