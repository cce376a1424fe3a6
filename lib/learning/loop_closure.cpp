#include "learning/loop_closure.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <stdexcept>
#include <string>

#include "learning/keyframe.h"
#include "learning/model_edit.h"
#include "model/confidence.h"

namespace vantage::learning {
namespace {

constexpr double kRadians = M_PI / 180.0;

// --- Which older views to try ---

double ShareOfPoints(const model::View& a, const model::View& b) {
  return double(SharedPoints(a, b)) / std::max<size_t>(1, std::min(a.points.size(), b.points.size()));
}

std::vector<int> Candidates(const model::ObjectModel& object, int view, const LoopClosureParams& params) {
  const model::View& seen = object.views[view];
  const measures::Viewpoint from = seen.viewpoint();
  std::vector<std::pair<double, int>> near;
  for (int older = 0; older < view - params.min_views_between; ++older) {
    const measures::Viewpoint other = object.views[older].viewpoint();
    const double angle = geometry::AngleBetween(from.direction, other.direction);
    if (angle >= params.max_view_angle_deg * kRadians) continue;
    if (std::abs(std::log2(from.distance_m / other.distance_m)) >= params.max_octaves) continue;
    if (ShareOfPoints(seen, object.views[older]) < params.max_shared) near.emplace_back(angle, older);
  }
  std::sort(near.begin(), near.end());
  std::vector<int> candidates;
  for (const auto& [angle, older] : near) {
    if (static_cast<int>(candidates.size()) < params.max_candidates) candidates.push_back(older);
  }
  return candidates;
}

// --- The pose against one older view alone ---

std::vector<features::Match> MutualMatches(const cv::Mat& query, const cv::Mat& train, double max_ratio) {
  std::vector<int> back(train.rows, -1);
  for (const features::Match& match : features::MatchRatio(train, query, max_ratio)) back[match.query] = match.train;
  std::vector<features::Match> mutual;
  for (const features::Match& match : features::MatchRatio(query, train, max_ratio)) {
    if (back[match.train] == match.query) mutual.push_back(match);
  }
  return mutual;
}

// Standard deviation of pixels in the direction in which they spread least, of the root of the area.
double Spread(const std::vector<pose::Match2d3d>& matches, const std::vector<int>& index, int area_px) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const int i : index) mean += matches[i].pixel / double(index.size());
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  for (const int i : index) covariance += (matches[i].pixel - mean) * (matches[i].pixel - mean).transpose() / double(index.size());
  const double least = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(covariance, Eigen::EigenvaluesOnly).eigenvalues()(0);
  return std::sqrt(std::max(0.0, least) / std::max(1, area_px));
}

std::optional<geometry::Rigid> PoseAgainst(const model::ObjectModel& object, const model::View& view, const model::View& older,
                                           const LoopClosureParams& params, LinkAttempt* attempt) {
  std::vector<pose::Match2d3d> matches;
  for (const features::Match& match : MutualMatches(view.features.descriptors, older.features.descriptors, params.max_ratio)) {
    const Eigen::Vector2d pixel = PixelOf(view, match.query);
    const double depth_m = rgbd::DepthAt(view.keyframe, pixel).value_or(0.0);
    matches.push_back({pixel, object.points[older.points[match.train]].position, depth_m});
  }
  attempt->matches = static_cast<int>(matches.size());
  if (attempt->matches < params.min_inliers) return std::nullopt;
  const auto estimate = pose::EstimatePose(matches, view.keyframe.camera, &view.keyframe, params.ransac, params.seed);
  if (!estimate) return std::nullopt;
  attempt->inliers = static_cast<int>(estimate->inliers.size());
  const geometry::PoseDifference drift = geometry::Difference(estimate->T_camera_object, view.T_camera_object);
  attempt->drift_m = drift.translation_m;
  attempt->drift_rad = drift.rotation_rad;
  if (attempt->inliers < params.min_inliers || attempt->inliers < params.min_inlier_share * attempt->matches) return std::nullopt;
  if (Spread(matches, estimate->inliers, cv::countNonZero(view.mask)) < params.min_spread) return std::nullopt;
  if (attempt->drift_m > params.max_drift_m || attempt->drift_rad > params.max_drift_deg * kRadians) return std::nullopt;
  return estimate->T_camera_object;
}

// --- Whether the depth images agree ---

struct SurfaceAgreement {
  int facing = 0;    // Samples that face the camera and whose place in the image is known.
  int agree = 0;     // The depth measured there is theirs.
  int conflict = 0;  // The camera sees through them, or they stick out of the object's outline.
};

// Whether the object was cut off by the image on the side on which a pixel outside the crop lies: nothing is known there then.
bool IsBeyondImage(const model::View& view, const Eigen::Vector2d& pixel) {
  const auto touches = [&](const cv::Mat& border) { return cv::countNonZero(border) > 0; };
  const cv::Mat& mask = view.mask;
  return (pixel.x() < 0 && touches(mask.col(0))) || (pixel.y() < 0 && touches(mask.row(0))) ||
         (pixel.x() > mask.cols - 1 && touches(mask.col(mask.cols - 1))) ||
         (pixel.y() > mask.rows - 1 && touches(mask.row(mask.rows - 1)));
}

// Samples of one view's surface held against what another measured; T_other_object is of the object coordinates the samples are in.
SurfaceAgreement Compare(const std::vector<pose::SurfacePoint>& surface, const geometry::Rigid& T_other_object,
                         const model::View& other, double tolerance_m) {
  SurfaceAgreement agreement;
  for (const pose::SurfacePoint& sample : surface) {
    const Eigen::Vector3d p = T_other_object * sample.point;
    const double toward = (T_other_object.linear() * sample.normal).dot(p);  // Negative where it faces the camera.
    const auto pixel = other.keyframe.camera.Project(p);
    if (!pixel || toward > -0.3 * p.norm()) continue;
    if (!other.keyframe.camera.Contains(*pixel)) {
      if (IsBeyondImage(other, *pixel)) continue;
      ++agreement.facing;
      ++agreement.conflict;
      continue;
    }
    const auto depth_m = rgbd::DepthAt(other.keyframe, *pixel);
    if (!depth_m) continue;
    ++agreement.facing;
    const bool on_object = other.mask.at<uchar>(std::lround(pixel->y()), std::lround(pixel->x())) > 0;
    const double in_front_m = *depth_m - p.z();
    if (on_object && std::abs(toward * in_front_m / p.z()) < tolerance_m) {
      ++agreement.agree;  // To the plane of the sample.
    } else if (in_front_m > 2.0 * tolerance_m) {
      ++agreement.conflict;
    }
  }
  return agreement;
}

bool SurfacesAgree(const model::View& view, const model::View& older, const geometry::Rigid& T_camera_object,
                   const LoopClosureParams& params, LinkAttempt* attempt) {
  // Each view's samples are in object coordinates by its own pose; where the older view is right the new one is at T_camera_object.
  const geometry::Rigid T_view_in_older = T_camera_object;
  const geometry::Rigid T_older_in_view = older.T_camera_object * T_camera_object.inverse() * view.T_camera_object;
  const SurfaceAgreement there =
      Compare(SurfaceOfView(older, params.surface_samples), T_view_in_older, view, params.surface_tolerance_m);
  const SurfaceAgreement back =
      Compare(SurfaceOfView(view, params.surface_samples), T_older_in_view, older, params.surface_tolerance_m);
  const auto share = [](int part, int whole) { return double(part) / std::max(1, whole); };
  attempt->surface_overlap = std::min(share(there.agree, there.facing), share(back.agree, back.facing));
  attempt->surface_conflict = std::max(share(there.conflict, there.facing), share(back.conflict, back.facing));
  return attempt->surface_overlap >= params.min_surface_overlap && attempt->surface_conflict <= params.max_surface_conflict;
}

// --- Links under a verified pose ---

// Keypoints of the view and points of the older one that project to them and look alike, the best for each other.
std::vector<Link> LinksUnder(const model::ObjectModel& object, int view_index, const model::View& older,
                             const geometry::Rigid& T_camera_object, const LoopClosureParams& params) {
  constexpr double kMaxDistance = 0.75;  // Of descriptors: the place speaks for them already.
  const model::View& view = object.views[view_index];
  const geometry::PinholeCamera& camera = view.keyframe.camera;
  const model::KeypointGrid grid(view.features.keypoints, camera.width, camera.height);
  std::map<int, std::pair<double, int>> best_of_keypoint;  // Distance and the older view's keypoint.
  std::map<int, std::pair<double, int>> best_of_older;     // The other way round.
  for (int k = 0; k < older.features.size(); ++k) {
    const Eigen::Vector3d p = T_camera_object * object.points[older.points[k]].position;
    const auto pixel = camera.Project(p);
    if (!pixel) continue;
    for (const int near : grid.Near(*pixel, params.ransac.inlier_px)) {
      const auto depth_m = rgbd::DepthAt(view.keyframe, PixelOf(view, near));
      if (depth_m && std::abs(*depth_m - p.z()) > params.ransac.max_depth_error_m) continue;
      const double distance = cv::norm(view.features.descriptors.row(near), older.features.descriptors.row(k), cv::NORM_L2);
      if (distance > kMaxDistance) continue;
      const auto keep_better = [&](std::map<int, std::pair<double, int>>* best, int from, int to) {
        const auto found = best->find(from);
        if (found == best->end() || distance < found->second.first) (*best)[from] = {distance, to};
      };
      keep_better(&best_of_keypoint, near, k);
      keep_better(&best_of_older, k, near);
    }
  }
  std::vector<Link> links;
  for (const auto& [keypoint, partner] : best_of_keypoint) {
    const int point = older.points[partner.second];
    if (best_of_older[partner.second].second == keypoint && view.points[keypoint] != point)
      links.push_back({view_index, keypoint, point});
  }
  return links;
}

// --- Merging ---

// Points that are one (union-find), and where every view saw them.
class MergedPoints {
 public:
  explicit MergedPoints(const model::ObjectModel& object) : parent_(object.points.size()), seen_at_(object.points.size()) {
    std::iota(parent_.begin(), parent_.end(), 0);
    for (int v = 0; v < static_cast<int>(object.views.size()); ++v) {
      for (size_t k = 0; k < object.views[v].points.size(); ++k) {
        seen_at_[object.views[v].points[k]].emplace_back(v, PixelOf(object.views[v], static_cast<int>(k)));
      }
    }
  }

  int Root(int point) const {
    while (parent_[point] != point) point = parent_[point];
    return point;
  }

  // Unless a view saw both at different places.
  void Merge(int a, int b) {
    constexpr double kSamePlacePx = 4.0;
    a = Root(a);
    b = Root(b);
    if (a == b) return;
    if (a > b) std::swap(a, b);
    for (const auto& [view_a, pixel_a] : seen_at_[a]) {
      for (const auto& [view_b, pixel_b] : seen_at_[b]) {
        if (view_a == view_b && (pixel_a - pixel_b).norm() > kSamePlacePx) return;
      }
    }
    parent_[b] = a;
    seen_at_[a].insert(seen_at_[a].end(), seen_at_[b].begin(), seen_at_[b].end());
  }

 private:
  std::vector<int> parent_;
  std::vector<std::vector<std::pair<int, Eigen::Vector2d>>> seen_at_;
};

// Share of the linked keypoints, and of the sightings of their points by other views, whichever is less, that agree.
double LinkedInliers(const model::ObjectModel& object, const std::vector<Link>& links, double max_error_px) {
  std::set<int> linked;
  for (const Link& link : links) linked.insert(object.views[link.view].points[link.keypoint]);
  int own = 0, own_agree = 0, others = 0, others_agree = 0;
  for (int v = 0; v < static_cast<int>(object.views.size()); ++v) {
    const model::View& view = object.views[v];
    for (int k = 0; k < view.features.size(); ++k) {
      if (linked.count(view.points[k]) == 0) continue;
      const pose::Match2d3d match{PixelOf(view, k), object.points[view.points[k]].position, 0.0};
      const bool agrees = pose::ReprojectionError(match, view.keyframe.camera, view.T_camera_object) <= max_error_px;
      ++(v == links.front().view ? own : others);
      (v == links.front().view ? own_agree : others_agree) += agrees;
    }
  }
  return std::min(double(own_agree) / std::max(1, own), double(others_agree) / std::max(1, others));
}

}  // namespace

void LoopClosureParams::Check() const {
  ransac.Check();
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(std::string("loop_closure: ") + what);
  };
  const auto is_share = [](double value) { return value >= 0.0 && value <= 1.0; };
  require(max_view_angle_deg > 0.0 && max_view_angle_deg <= 180.0, "max_view_angle_deg must be in (0, 180]");
  require(max_octaves > 0.0, "max_octaves must be > 0");
  require(max_shared > 0.0 && max_shared <= 1.0, "max_shared must be in (0, 1]");
  require(min_views_between >= 0, "min_views_between must be >= 0");
  require(max_candidates >= 1, "max_candidates must be >= 1");
  require(max_ratio > 0.0 && max_ratio <= 1.0, "max_ratio must be in (0, 1]");
  require(min_inliers >= 6, "min_inliers must be >= 6");
  require(is_share(min_inlier_share), "min_inlier_share must be in [0, 1]");
  require(min_spread >= 0.0, "min_spread must be >= 0");
  require(max_drift_m > 0.0, "max_drift_m must be > 0");
  require(max_drift_deg > 0.0, "max_drift_deg must be > 0");
  require(surface_samples >= 50, "surface_samples must be >= 50");
  require(surface_tolerance_m > 0.0, "surface_tolerance_m must be > 0");
  require(is_share(min_surface_overlap), "min_surface_overlap must be in [0, 1]");
  require(is_share(max_surface_conflict), "max_surface_conflict must be in [0, 1]");
  require(is_share(min_linked_inliers), "min_linked_inliers must be in [0, 1]");
}

std::vector<Link> FindLinks(const model::ObjectModel& object, int view_index, const LoopClosureParams& params,
                            std::vector<LinkAttempt>* attempts) {
  params.Check();
  if (view_index < 0 || view_index >= static_cast<int>(object.views.size()))
    throw std::invalid_argument("loop_closure: no view " + std::to_string(view_index));
  const model::View& view = object.views[view_index];
  std::vector<Link> links;
  if (view.keyframe.depth.empty()) return links;  // Nothing to verify with.
  for (const int candidate : Candidates(object, view_index, params)) {
    const model::View& older = object.views[candidate];
    LinkAttempt attempt;
    attempt.view = candidate;
    const auto T_camera_object = PoseAgainst(object, view, older, params, &attempt);
    if (T_camera_object && SurfacesAgree(view, older, *T_camera_object, params, &attempt)) {
      const std::vector<Link> found = LinksUnder(object, view_index, older, *T_camera_object, params);
      attempt.links = static_cast<int>(found.size());
      links.insert(links.end(), found.begin(), found.end());
    }
    if (attempts) attempts->push_back(attempt);
  }
  return links;
}

bool ComesBack(const model::ObjectModel& object, int view, int min_shared) {
  int most_older = 0;  // Shared with any view learned before the one at hand.
  for (int older = 0; older < view; ++older) {
    const int shared = SharedPoints(object.views[view], object.views[older]);
    if (most_older >= min_shared && 2 * shared < most_older) return true;
    most_older = std::max(most_older, shared);
  }
  return false;
}

model::ObjectModel Linked(const model::ObjectModel& object, const std::vector<Link>& links) {
  MergedPoints merged(object);
  for (const Link& link : links) merged.Merge(object.views[link.view].points[link.keypoint], link.point);
  model::ObjectModel result = object;
  for (model::View& view : result.views) {
    for (int& point : view.points) point = merged.Root(point);
  }
  DropUnusedPoints(&result);
  return result;
}

std::optional<model::ObjectModel> WithLoopClosed(const model::ObjectModel& object, int view, const LoopClosureParams& params,
                                                 const RefinementParams& refinement, ClosureReport* report) {
  ClosureReport own;
  if (!report) report = &own;
  *report = {};
  const std::vector<Link> links = FindLinks(object, view, params, &report->attempts);
  report->links = static_cast<int>(links.size());
  if (links.empty()) return std::nullopt;
  RefinementParams keep_all = refinement;  // The links are judged before any is given up.
  keep_all.max_link_error_sigmas = std::numeric_limits<double>::infinity();
  const model::ObjectModel refined = Refined(Linked(object, links), 1, keep_all, &report->refinement);
  const double max_error_px = 3.0 * refinement.bundle.robust_sigmas * refinement.bundle.pixel_sigma;
  report->linked_inliers = LinkedInliers(refined, links, max_error_px);
  if (report->linked_inliers < params.min_linked_inliers) return std::nullopt;
  return WithoutWrongLinks(refined, 1, refinement, &report->refinement.unlinked);
}

}  // namespace vantage::learning
