#include "learning/upkeep.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>

#include "learning/model_edit.h"

namespace vantage::learning {
namespace {

int CountFeatures(const model::ObjectModel& object) {
  int count = 0;
  for (const model::View& view : object.views) count += view.features.size();
  return count;
}

// Keypoints of points that fail disappear from all views; the points go with DropUnusedPoints.
int DropFailing(const std::vector<PointStatistics>& statistics, const UpkeepParams& params, model::ObjectModel* object) {
  std::vector<bool> fails(object->points.size(), false);
  for (size_t p = 0; p < statistics.size(); ++p) {
    fails[p] = statistics[p].visible >= params.min_visible && statistics[p].seen < params.min_seen_share * statistics[p].visible;
  }
  for (model::View& view : object->views) {
    std::vector<int> kept;
    for (int k = 0; k < view.features.size(); ++k) {
      if (!fails[view.points[k]]) kept.push_back(k);
    }
    KeepKeypoints(kept, &view);
  }
  return static_cast<int>(std::count(fails.begin(), fails.end(), true));
}

// Of two views that crowd each other, the one goes that has others nearer by, or else the one with fewer points of its own; until
// none are crowded.
class ViewThinning {
 public:
  ViewThinning(const UpkeepParams& params, model::ObjectModel* object) : params_(params), object_(object) {
    views_seeing_.assign(object->points.size(), 0);
    for (const model::View& view : object->views) CountPoints(view, 1);
  }

  int Run() {
    const size_t before = object_->views.size();
    for (;;) {
      const int surplus = Surplus();
      if (surplus < 0) break;
      CountPoints(object_->views[surplus], -1);
      object_->views.erase(object_->views.begin() + surplus);
    }
    return static_cast<int>(before - object_->views.size());
  }

 private:
  void CountPoints(const model::View& view, int sign) {
    std::vector<int> seen = view.points;
    std::sort(seen.begin(), seen.end());
    seen.erase(std::unique(seen.begin(), seen.end()), seen.end());
    for (const int point : seen) views_seeing_[point] += sign;
  }

  int OwnPoints(const model::View& view) const {
    return static_cast<int>(std::count_if(view.points.begin(), view.points.end(), [&](int p) { return views_seeing_[p] == 1; }));
  }

  // How far apart two views are, 1 = just not redundant: the larger of angle and octaves, each by its limit.
  double Separation(const model::View& a, const model::View& b) const {
    const measures::Viewpoint from_a = a.viewpoint(), from_b = b.viewpoint();
    const double angle_deg = geometry::AngleBetween(from_a.direction, from_b.direction) * 180.0 / M_PI;
    const double octaves = std::abs(std::log2(from_a.distance_m / from_b.distance_m));
    const auto share = [](double value, double limit) {
      return limit > 0.0 ? value / limit : std::numeric_limits<double>::infinity();
    };
    return std::max(share(angle_deg, params_.redundant_angle_deg), share(octaves, params_.redundant_octaves));
  }

  // To the nearest view but `pair`.
  double Gap(int view, int pair) const {
    double gap = std::numeric_limits<double>::infinity();
    for (int other = 0; other < static_cast<int>(object_->views.size()); ++other) {
      if (other != view && other != pair) gap = std::min(gap, Separation(object_->views[view], object_->views[other]));
    }
    return gap;
  }

  bool MayGo(int view) const { return view > 0 && view + 1 < static_cast<int>(object_->views.size()); }

  // The view to drop next, -1 where none is too many.
  int Surplus() const {
    const int count = static_cast<int>(object_->views.size());
    const double limit = count > params_.max_views ? std::numeric_limits<double>::infinity() : 1.0;
    for (int v = 1; v + 1 < count; ++v) {
      if (object_->views[v].features.size() < params_.min_view_points) return v;
    }
    double closest = std::numeric_limits<double>::infinity();
    std::pair<int, int> pair{-1, -1};
    for (int a = 0; a < count; ++a) {
      for (int b = a + 1; b < count; ++b) {
        if (!MayGo(a) && !MayGo(b)) continue;
        const double separation = Separation(object_->views[a], object_->views[b]);
        if (separation >= closest || !(separation < limit)) continue;
        closest = separation;
        pair = {a, b};
      }
    }
    if (pair.first < 0) return -1;
    if (!MayGo(pair.first)) return pair.second;
    if (!MayGo(pair.second)) return pair.first;
    constexpr double kAlike = 1.1;
    const double gap_a = Gap(pair.first, pair.second), gap_b = Gap(pair.second, pair.first);
    if (gap_a > kAlike * gap_b) return pair.second;
    if (gap_b > kAlike * gap_a) return pair.first;
    return OwnPoints(object_->views[pair.first]) <= OwnPoints(object_->views[pair.second]) ? pair.first : pair.second;
  }

  const UpkeepParams& params_;
  model::ObjectModel* object_;
  std::vector<int> views_seeing_;
};

// A feature of a point: where it is.
struct Sample {
  int view = 0;
  int keypoint = 0;
};

// The newest sample, then always the one whose descriptor is farthest from all chosen (Gonzalez, 1985). Indices into samples.
std::vector<int> MostDifferent(const model::ObjectModel& object, const std::vector<Sample>& samples, int count) {
  std::vector<int> chosen{static_cast<int>(samples.size()) - 1};
  std::vector<double> distance(samples.size(), std::numeric_limits<double>::infinity());
  const auto row = [&](int i) { return object.views[samples[i].view].features.descriptors.row(samples[i].keypoint); };
  while (static_cast<int>(chosen.size()) < count) {
    for (size_t i = 0; i < samples.size(); ++i) {
      distance[i] = std::min(distance[i], cv::norm(row(static_cast<int>(i)), row(chosen.back()), cv::NORM_L2));
    }
    for (const int i : chosen) distance[i] = -1.0;
    chosen.push_back(static_cast<int>(std::max_element(distance.begin(), distance.end()) - distance.begin()));
  }
  return chosen;
}

void DropSurplusDescriptors(const UpkeepParams& params, model::ObjectModel* object) {
  std::vector<std::vector<Sample>> samples_of(object->points.size());
  std::vector<std::vector<bool>> keep(object->views.size());
  for (int v = 0; v < static_cast<int>(object->views.size()); ++v) {
    keep[v].assign(object->views[v].points.size(), true);
    for (size_t k = 0; k < object->views[v].points.size(); ++k) {
      samples_of[object->views[v].points[k]].push_back({v, static_cast<int>(k)});
    }
  }
  for (const std::vector<Sample>& samples : samples_of) {
    if (static_cast<int>(samples.size()) <= params.max_descriptors) continue;
    for (const Sample& sample : samples) keep[sample.view][sample.keypoint] = false;
    for (const int i : MostDifferent(*object, samples, params.max_descriptors)) keep[samples[i].view][samples[i].keypoint] = true;
  }
  for (size_t v = 0; v < object->views.size(); ++v) {
    std::vector<int> kept;
    for (size_t k = 0; k < keep[v].size(); ++k) {
      if (keep[v][k]) kept.push_back(static_cast<int>(k));
    }
    KeepKeypoints(kept, &object->views[v]);
  }
}

}  // namespace

void UpkeepParams::Check() const {
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(std::string("upkeep: ") + what);
  };
  require(max_descriptors >= 2, "max_descriptors must be >= 2");
  require(min_visible >= 1, "min_visible must be >= 1");
  require(min_seen_share >= 0.0 && min_seen_share < 1.0, "min_seen_share must be in [0, 1)");
  require(redundant_angle_deg >= 0.0, "redundant_angle_deg must be >= 0");
  require(redundant_octaves >= 0.0, "redundant_octaves must be >= 0");
  require(max_views >= 2, "max_views must be >= 2");
  require(min_view_points >= 0, "min_view_points must be >= 0");
}

model::ObjectModel Kept(const model::ObjectModel& object, const std::vector<PointStatistics>& statistics,
                        const UpkeepParams& params, UpkeepReport* report) {
  params.Check();
  if (!statistics.empty() && statistics.size() != object.points.size()) {
    throw std::invalid_argument("upkeep: expected statistics of " + std::to_string(object.points.size()) + " points, found " +
                                std::to_string(statistics.size()));
  }
  UpkeepReport own;
  if (!report) report = &own;
  *report = {};
  model::ObjectModel kept = object;
  report->failing_points = DropFailing(statistics, params, &kept);
  report->views_dropped = ViewThinning(params, &kept).Run();
  DropSurplusDescriptors(params, &kept);
  report->views_dropped += ViewThinning(params, &kept).Run();  // Views that now have too few features of their own.
  DropUnusedPoints(&kept);
  report->points_dropped = static_cast<int>(object.points.size() - kept.points.size());
  report->descriptors_dropped = CountFeatures(object) - CountFeatures(kept);
  return kept;
}

}  // namespace vantage::learning
