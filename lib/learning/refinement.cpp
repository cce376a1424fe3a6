#include "learning/refinement.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>

#include "learning/keyframe.h"
#include "learning/model_edit.h"

namespace vantage::learning {
namespace {

// How many views see each point, and the first that does (-1 = none).
struct Sightings {
  std::vector<int> views;
  std::vector<int> first;

  explicit Sightings(const model::ObjectModel& object) : views(object.points.size(), 0), first(object.points.size(), -1) {
    std::vector<int> last(object.points.size(), -1);
    for (int v = 0; v < static_cast<int>(object.views.size()); ++v) {
      for (const int point : object.views[v].points) {
        if (last[point] == v) continue;  // Two keypoints of one view.
        last[point] = v;
        ++views[point];
        if (first[point] < 0) first[point] = v;
      }
    }
  }
};

pose::BundleProblem ProblemOf(const model::ObjectModel& object, const Sightings& sightings, int first_free_view, bool use_depth,
                              const std::vector<std::optional<pose::PosePrior>>& priors) {
  pose::BundleProblem problem;
  for (int v = 0; v < static_cast<int>(object.views.size()); ++v) {
    const model::View& view = object.views[v];
    problem.views.push_back({view.T_camera_object, view.keyframe.camera, v < first_free_view,
                             priors.empty() ? std::optional<pose::PosePrior>() : priors[v]});
  }
  // Only what a free view sees can move; depth is looked up for nothing else.
  std::vector<bool> in_play(object.points.size(), false);
  for (size_t v = first_free_view; v < object.views.size(); ++v) {
    for (const int point : object.views[v].points) in_play[point] = sightings.views[point] >= 2;
  }
  for (const model::ModelPoint& point : object.points) problem.points.push_back(point.position);
  for (int v = 0; v < static_cast<int>(object.views.size()); ++v) {
    const model::View& view = object.views[v];
    for (size_t k = 0; k < view.points.size(); ++k) {
      if (!in_play[view.points[k]]) continue;
      const Eigen::Vector2d pixel = PixelOf(view, static_cast<int>(k));
      const bool measured = use_depth || v == 0;
      problem.observations.push_back(
          {v, view.points[k], pixel, measured ? rgbd::DepthAt(view.keyframe, pixel).value_or(0.0) : 0.0});
    }
  }
  return problem;
}

// A view and how near it is to another.
struct Kin {
  int view = 0;
  int shared = 0;          // Points.
  double angle_rad = 0.0;  // Between directions.
};

// The first `count` views but this one, the nearest of kin first: those that share most points with it (they were placed by each
// other, while direction misleads where drift is being taken out), then the nearest in direction.
std::vector<Kin> ByKinship(const model::ObjectModel& object, int view, int count) {
  std::vector<std::tuple<int, double, int>> order;
  for (int other = 0; other < count; ++other) {
    if (other == view) continue;
    const int shared = SharedPoints(object.views[view], object.views[other]);
    const double angle =
        geometry::AngleBetween(object.views[view].viewpoint().direction, object.views[other].viewpoint().direction);
    order.emplace_back(-shared, angle, other);
  }
  std::sort(order.begin(), order.end());
  std::vector<Kin> kin;
  for (const auto& [shared, angle, other] : order) kin.push_back({other, -shared, angle});
  return kin;
}

// What a view shows, in its camera's coordinates.
pose::Appearance AppearanceInCamera(model::View view, const RefinementParams& params) {
  view.T_camera_object = geometry::Rigid::Identity();
  pose::Appearance appearance;
  if (params.use_depth) appearance.surface = SurfaceOfView(view, params.surface_samples);
  appearance.textures.push_back(TextureOfView(view, params.texture_samples));
  return appearance;
}

// How far apart two poses put what a view shows, in the mean.
double MeanMove(const pose::Appearance& appearance, const geometry::Rigid& T_a, const geometry::Rigid& T_b) {
  double sum = 0.0;
  int count = 0;
  const auto add = [&](const Eigen::Vector3d& point) {
    sum += (T_a * point - T_b * point).norm();
    ++count;
  };
  for (const pose::SurfacePoint& sample : appearance.surface) add(sample.point);
  for (const auto& texture : appearance.textures) {
    for (const pose::TexturePoint& sample : texture) add(sample.point);
  }
  return sum / std::max(1, count);
}

// Two views: what the first looks like is fitted to the images of the second.
struct Pair {
  int a = 0;
  int b = 0;
  bool is_linked = true;  // They share points, or came one after the other; else only a likeness tells that they show the same.

  bool operator<(const Pair& other) const { return std::tie(a, b) < std::tie(other.a, other.b); }
};
using Pairs = std::set<Pair>;

constexpr double kBeside_rad = 25.0 * M_PI / 180.0;  // Views that show much of the same, whether they share points or not.

// Free views and the ones learned just before them beside them, whose places to each other tracking has just seen.
Pairs PairsInARow(const model::ObjectModel& object, int first_free_view) {
  Pairs pairs;
  for (int v = first_free_view; v < static_cast<int>(object.views.size()); ++v) {
    if (geometry::AngleBetween(object.views[v - 1].viewpoint().direction, object.views[v].viewpoint().direction) > kBeside_rad)
      continue;
    pairs.insert({v - 1, v});
    pairs.insert({v, v - 1});
  }
  return pairs;
}

// Which views are held against which: free ones against those that share most points with them and, where surfaces help, those
// beside them that share too few. Both ways, since each sees the other's appearance where it is seen best; where depth must not
// place a view, older ones' against newer images only.
Pairs PairsToRelate(const model::ObjectModel& object, int first_free_view, const RefinementParams& params) {
  const int count = static_cast<int>(object.views.size());
  Pairs pairs;
  for (int v = first_free_view; v < count; ++v) {
    const std::vector<Kin> kin = ByKinship(object, v, count);
    for (int i = 0; i < std::min(params.related_views, static_cast<int>(kin.size())); ++i) {
      const bool share_points = kin[i].shared >= params.min_shared_points;
      if (!share_points && (!params.use_depth || kin[i].angle_rad > kBeside_rad)) continue;
      const bool is_linked = share_points || std::abs(v - kin[i].view) <= 2;
      pairs.insert({std::min(v, kin[i].view), std::max(v, kin[i].view), is_linked});
      if (params.use_depth) pairs.insert({std::max(v, kin[i].view), std::min(v, kin[i].view), is_linked});
    }
  }
  return pairs;
}

// How far from where the surface alone wants it a fit of surface and texture is: squared, in standard deviations of the former.
double Contradiction(const pose::DenseFit& both, const pose::DenseFit& surface) {
  const geometry::Rigid moved = both.T_camera_object * surface.T_camera_object.inverse();
  const Eigen::AngleAxisd turn(moved.linear());
  Eigen::Matrix<double, 6, 1> step;
  step << moved.translation(), turn.angle() * turn.axis();
  return step.dot(surface.information * step);
}

// What one view looks like fitted to the images of another; nullopt where nothing says that they show the same. The surface alone
// is asked where looks led astray: what does not look alike where they drew it (a blur, a shine), and, where few shared points say
// that there is print to go by, what the surface contradicts (an outline inside the object, as of a cap before its bottle, has a
// gradient but stays with the camera).
std::optional<pose::DenseFit> FitOfPair(const pose::Appearance& appearance, const rgbd::Frame& frame, const geometry::Rigid& T_b_a,
                                        bool is_linked, int shared, const RefinementParams& params) {
  constexpr int kPrint = 15;                  // Shared points: as many as hold a pose that is learned from.
  constexpr double kMaxContradiction = 12.6;  // Six degrees of freedom stay below it by chance 95 times in 100.
  const pose::SmoothImage image(frame, cv::Rect({0, 0}, frame.color.size()));
  const pose::DenseFit both = pose::FitDensely(appearance, frame, &image, T_b_a, params.dense);
  const bool alike = both.likeness.value_or(is_linked ? 1.0 : 0.0) >= params.min_likeness;
  if (!alike && !is_linked) return std::nullopt;
  if (!params.use_depth || (alike && shared >= kPrint)) return both;
  const pose::DenseFit surface = pose::FitDensely({appearance.surface, {}}, frame, nullptr, T_b_a, params.dense);
  return alike && Contradiction(both, surface) <= kMaxContradiction ? both : surface;
}

// Depth and colour images of pairs of views fitted to each other, from where the problem has them.
std::vector<pose::BundleRelation> RelationsOf(const model::ObjectModel& object, const pose::BundleProblem& problem,
                                              const Pairs& pairs, const RefinementParams& params) {
  std::vector<pose::BundleRelation> relations;
  pose::Appearance appearance;  // Of view a; pairs come sorted by a.
  int appearance_of = -1;
  for (const auto& [a, b, is_linked] : pairs) {
    if (appearance_of != a) {
      appearance = AppearanceInCamera(object.views[a], params);
      appearance_of = a;
    }
    rgbd::Frame frame = object.views[b].keyframe;
    if (!params.use_depth) frame.depth = cv::Mat();
    const geometry::Rigid T_b_a = problem.views[b].T_camera_object * problem.views[a].T_camera_object.inverse();
    const int shared = SharedPoints(object.views[a], object.views[b]);
    const auto found = FitOfPair(appearance, frame, T_b_a, is_linked, shared, params);
    if (!found) continue;
    const pose::DenseFit& fit = *found;
    if (4 * fit.samples <= params.surface_samples && 4 * fit.texture_samples <= params.texture_samples) continue;
    if (MeanMove(appearance, T_b_a, fit.T_camera_object) > params.max_relation_move_m) continue;
    relations.push_back({a, b, fit.T_camera_object, fit.information});
  }
  return relations;
}

// Maps object coordinates as view `before` had them to those of `after`.
geometry::Rigid Change(const model::View& before, const model::View& after) {
  return after.T_camera_object.inverse() * before.T_camera_object;
}

void MoveBy(const geometry::Rigid& T, model::ModelPoint* point) {
  point->position = T * point->position;
  point->normal = T.linear() * point->normal;
}

// --- Rebased ---

void RequireAppended(const model::ObjectModel& base, const model::ObjectModel& current) {
  bool same = current.views.size() >= base.views.size() && current.points.size() >= base.points.size();
  for (size_t v = 0; same && v < base.views.size(); ++v) {
    same = base.views[v].id == current.views[v].id && base.views[v].points == current.views[v].points;
  }
  if (!same) throw std::invalid_argument("rebased: expected the base model with views appended, found another");
}

// Where each point of base went, by the keypoints that are in both (whose pixels, sizes and order do not change).
std::vector<int> PointsGoneTo(const model::ObjectModel& base, const model::ObjectModel& changed) {
  std::vector<int> gone_to(base.points.size(), -1);
  for (const model::View& view : changed.views) {
    const int index = IndexOfView(base, view.id);
    if (index < 0) continue;
    const model::View& before = base.views[index];
    int k = 0;
    for (size_t now = 0; now < view.points.size(); ++now) {
      const auto key = [](const cv::KeyPoint& p) { return std::tuple(p.pt.x, p.pt.y, p.size, p.angle, p.response); };
      const auto wanted = key(view.features.keypoints[now]);
      while (k < before.features.size() && key(before.features.keypoints[k]) != wanted) ++k;
      if (k == before.features.size()) break;
      int& target = gone_to[before.points[k++]];
      if (target < 0) target = view.points[now];
    }
  }
  return gone_to;
}

}  // namespace

void RefinementParams::Check() const {
  bundle.Check();
  dense.Check();
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(std::string("refinement: ") + what);
  };
  require(surface_samples >= 0, "surface_samples must be >= 0");
  require(texture_samples >= 0, "texture_samples must be >= 0");
  require(related_views >= 1, "related_views must be >= 1");
  require(min_shared_points >= 1, "min_shared_points must be >= 1");
  require(min_likeness >= -1.0 && min_likeness <= 1.0, "min_likeness must be in [-1, 1]");
  require(max_relation_move_m > 0.0, "max_relation_move_m must be > 0");
  require(max_link_error_sigmas > 0.0, "max_link_error_sigmas must be > 0");
}

model::ObjectModel Refined(const model::ObjectModel& object, int first_free_view, const RefinementParams& params,
                           RefinementReport* report, const std::vector<std::optional<pose::PosePrior>>& priors) {
  params.Check();
  if (!priors.empty() && priors.size() != object.views.size())
    throw std::invalid_argument("refinement: expected no prior or one per view, found " + std::to_string(priors.size()));
  first_free_view = std::clamp(first_free_view, 1, std::max(1, static_cast<int>(object.views.size())));
  RefinementReport own;
  if (!report) report = &own;
  *report = {};
  const Sightings sightings(object);
  pose::BundleProblem problem = ProblemOf(object, sightings, first_free_view, params.use_depth, priors);
  pose::BundleParams coarse = params.bundle;
  const bool related = (params.use_depth && params.surface_samples > 0) || params.texture_samples > 0;
  if (related) coarse.tolerance *= 10.0;  // It is only where relations start from.
  // A plain side's few points would let its views slide; drift between views in a row is small enough to begin with.
  if (params.use_depth) problem.relations = RelationsOf(object, problem, PairsInARow(object, first_free_view), params);
  report->bundle = pose::AdjustBundle(&problem, coarse);
  if (related) {
    problem.relations = RelationsOf(object, problem, PairsToRelate(object, first_free_view, params), params);
    const pose::BundleReport points_alone = report->bundle;
    pose::BundleParams fine = params.bundle;
    fine.max_anneal = 1.0;  // The start is good.
    report->bundle = pose::AdjustBundle(&problem, fine);
    report->bundle.initial_cost = points_alone.initial_cost;
    report->bundle.iterations += points_alone.iterations;
    report->bundle.initial_rms_px = points_alone.initial_rms_px;
    report->bundle.initial_rms_depth_m = points_alone.initial_rms_depth_m;
    report->relations = static_cast<int>(problem.relations.size());
  }

  model::ObjectModel refined = object;
  for (size_t v = 0; v < refined.views.size(); ++v) {
    const geometry::PoseDifference moved = geometry::Difference(problem.views[v].T_camera_object, object.views[v].T_camera_object);
    report->max_moved_m = std::max(report->max_moved_m, moved.translation_m);
    report->max_turned_rad = std::max(report->max_turned_rad, moved.rotation_rad);
    refined.views[v].T_camera_object = problem.views[v].T_camera_object;
  }
  for (size_t p = 0; p < refined.points.size(); ++p) {
    const int v = sightings.first[p];
    if (v >= first_free_view) MoveBy(Change(object.views[v], refined.views[v]), &refined.points[p]);
    if (sightings.views[p] >= 2) refined.points[p].position = problem.points[p];
  }
  return WithoutWrongLinks(refined, first_free_view, params, &report->unlinked);
}

model::ObjectModel WithoutWrongLinks(const model::ObjectModel& object, int first_free_view, const RefinementParams& params,
                                     int* unlinked) {
  const Sightings sightings(object);
  const double max_error_px = params.max_link_error_sigmas * params.bundle.pixel_sigma;
  model::ObjectModel result = object;
  int wrong = 0;
  for (size_t v = first_free_view; v < result.views.size(); ++v) {
    model::View& view = result.views[v];
    const geometry::Rigid T_object_camera = view.T_camera_object.inverse();
    std::vector<int> kept;
    for (int k = 0; k < view.features.size(); ++k) {
      const pose::Match2d3d match{PixelOf(view, k), result.points[view.points[k]].position, 0.0};
      if (sightings.views[view.points[k]] >= 2 &&
          !(pose::ReprojectionError(match, view.keyframe.camera, view.T_camera_object) <= max_error_px)) {
        ++wrong;
        const auto point = rgbd::PointAt(view.keyframe, match.pixel);
        const auto normal = rgbd::NormalAt(view.keyframe, match.pixel);
        if (!point || !normal) continue;
        view.points[k] = static_cast<int>(result.points.size());
        result.points.push_back({T_object_camera * *point, T_object_camera.linear() * *normal});
      }
      kept.push_back(k);
    }
    KeepKeypoints(kept, &view);
  }
  if (wrong > 0) DropUnusedPoints(&result);
  if (unlinked) *unlinked = wrong;
  return result;
}

geometry::Rigid ChangeOf(const model::ObjectModel& before, const model::ObjectModel& after, int view_id) {
  const int index = IndexOfView(before, view_id);
  if (index < 0) throw std::invalid_argument("change: no view with id " + std::to_string(view_id));
  if (const int same = IndexOfView(after, view_id); same >= 0) return Change(before.views[index], after.views[same]);
  for (const Kin& kin : ByKinship(before, index, static_cast<int>(before.views.size()))) {
    const int same = IndexOfView(after, before.views[kin.view].id);
    if (same >= 0) return Change(before.views[kin.view], after.views[same]);
  }
  return geometry::Rigid::Identity();
}

model::ObjectModel Rebased(const model::ObjectModel& base, const model::ObjectModel& changed, const model::ObjectModel& current,
                           std::vector<int>* new_index) {
  RequireAppended(base, current);
  model::ObjectModel result = changed;
  result.name = current.name;
  result.measures = current.measures;
  std::vector<int> gone_to = PointsGoneTo(base, changed);
  gone_to.resize(current.points.size(), -1);
  for (size_t v = base.views.size(); v < current.views.size(); ++v) {
    model::View view = current.views[v];
    geometry::Rigid T_changed_base = geometry::Rigid::Identity();
    for (const Kin& kin : ByKinship(current, static_cast<int>(v), static_cast<int>(v))) {
      const int same = IndexOfView(result, current.views[kin.view].id);
      if (same < 0) continue;
      T_changed_base = Change(current.views[kin.view], result.views[same]);
      break;
    }
    for (int& point : view.points) {
      if (gone_to[point] < 0) {
        gone_to[point] = static_cast<int>(result.points.size());
        result.points.push_back(current.points[point]);
        MoveBy(T_changed_base, &result.points.back());
      }
      point = gone_to[point];
    }
    view.T_camera_object = view.T_camera_object * T_changed_base.inverse();
    result.views.push_back(std::move(view));
  }
  if (new_index) *new_index = std::move(gone_to);
  return result;
}

}  // namespace vantage::learning
