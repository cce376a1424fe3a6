#include "recognition/guided.h"

#include <cmath>
#include <map>
#include <numeric>

#include "features/inner_products.h"
#include "pose/refine.h"

namespace vantage::recognition {
namespace {

// The best model partner of each keypoint that has one near enough.
std::map<int, std::pair<double, GuidedMatch>> Partners(const model::ObjectModel& object, const geometry::Rigid& T_camera_object,
                                                       const geometry::PinholeCamera& camera, const features::Features& features,
                                                       const model::KeypointGrid& grid, double radius_px,
                                                       const GuidedParams& params) {
  std::map<int, std::pair<double, GuidedMatch>> partners;
  const double min_cosine = std::cos(80.0 * M_PI / 180.0);
  const int length = features.descriptors.cols;
  for (const int view_index : model::NearestViews(object, T_camera_object, params.views)) {
    const model::View& view = object.views[view_index];
    for (size_t k = 0; k < view.points.size(); ++k) {
      const model::ModelPoint& point = object.points[view.points[k]];
      const Eigen::Vector3d in_camera = T_camera_object * point.position;
      if (-(T_camera_object.linear() * point.normal).dot(in_camera.normalized()) < min_cosine) continue;
      const auto pixel = camera.Project(in_camera);
      if (!pixel || !camera.Contains(*pixel)) continue;
      const float* row = view.features.descriptors.ptr<float>(static_cast<int>(k));
      for (const int keypoint : grid.Near(*pixel, radius_px)) {
        const double distance = std::sqrt(features::SquaredDistance(features.descriptors.ptr<float>(keypoint), row, length));
        if (distance > params.max_distance) continue;
        const auto found = partners.find(keypoint);
        if (found != partners.end() && found->second.first <= distance) continue;
        partners[keypoint] = {distance, GuidedMatch{keypoint, view_index, static_cast<int>(k), view.points[k]}};
      }
    }
  }
  return partners;
}

}  // namespace

GuidedPose MatchGuided(const model::ObjectModel& object, const geometry::Rigid& T_camera_object, const rgbd::Frame& frame,
                       const features::Features& features, const model::KeypointGrid& grid, const GuidedParams& params) {
  GuidedPose result;
  result.T_camera_object = T_camera_object;
  for (const double radius_px : {params.radius_px, 0.5 * params.radius_px + params.inlier_px}) {
    std::vector<pose::Match2d3d> matches;
    std::vector<GuidedMatch> sources;
    for (const auto& [keypoint, partner] :
         Partners(object, result.T_camera_object, frame.camera, features, grid, radius_px, params)) {
      const cv::Point2f& pixel = features.keypoints[keypoint].pt;
      const double depth_m = rgbd::DepthAt(frame, {pixel.x, pixel.y}).value_or(0.0);
      matches.push_back({{pixel.x, pixel.y}, object.points[partner.second.point].position, depth_m});
      sources.push_back(partner.second);
    }
    if (static_cast<int>(matches.size()) >= params.min_matches) {
      std::vector<int> all(matches.size());
      std::iota(all.begin(), all.end(), 0);
      result.T_camera_object = pose::RefinePose(matches, all, frame.camera, result.T_camera_object, 0.5 * params.inlier_px);
    }
    result.matches.clear();
    for (size_t i = 0; i < matches.size(); ++i) {
      if (pose::ReprojectionError(matches[i], frame.camera, result.T_camera_object) < params.inlier_px)
        result.matches.push_back(sources[i]);
    }
  }
  return result;
}

}  // namespace vantage::recognition
