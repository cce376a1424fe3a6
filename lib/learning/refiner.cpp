#include "learning/refiner.h"

#include <algorithm>

#include "learning/model_edit.h"

namespace vantage::learning {
namespace {

// How many of a view's keypoints are points that other views see too.
int SharedPoints(const model::ObjectModel& object, int view) {
  std::vector<bool> elsewhere(object.points.size(), false);
  for (int other = 0; other < static_cast<int>(object.views.size()); ++other) {
    if (other == view) continue;
    for (const int point : object.views[other].points) elsewhere[point] = true;
  }
  const std::vector<int>& points = object.views[view].points;
  return static_cast<int>(std::count_if(points.begin(), points.end(), [&](int point) { return elsewhere[point]; }));
}

struct Job {
  std::shared_ptr<const model::ObjectModel> object;
  std::vector<int> new_views;
  std::vector<PointStatistics> statistics;
  std::map<int, pose::PosePrior> priors;
  LearnerParams params;

  std::vector<std::optional<pose::PosePrior>> PriorsOf(const model::ObjectModel& changed) const {
    std::vector<std::optional<pose::PosePrior>> of_views;
    if (priors.empty()) return of_views;
    for (const model::View& view : changed.views) {
      const auto found = priors.find(view.id);
      of_views.push_back(found == priors.end() ? std::nullopt : std::optional<pose::PosePrior>(found->second));
    }
    return of_views;
  }

  Refinement Run() const {
    Refinement result;
    result.base = object;
    result.changed = Kept(*object, statistics, params.upkeep);
    bool came_back = false;
    for (const int id : new_views) {
      const int view = IndexOfView(result.changed, id);
      if (view < 0) continue;
      came_back |= ComesBack(result.changed, view);
      if (!params.refinement.use_depth) continue;  // Depth is what tells a true closure from a false one.
      auto closed = WithLoopClosed(result.changed, view, params.loop_closure, params.refinement);
      if (!closed) continue;
      result.changed = std::move(*closed);
      ++result.closures;
    }
    std::map<int, int> links;  // Of the new views.
    for (const int id : new_views) {
      if (const int view = IndexOfView(result.changed, id); view > 0) links[id] = SharedPoints(result.changed, view);
    }
    // A closed loop moves everything, else it is the newest views that are not settled yet.
    const int views = static_cast<int>(result.changed.views.size());
    const int first_free = result.closures > 0 || came_back ? 1 : std::max(1, views - params.refined_views);
    result.changed = Refined(result.changed, first_free, params.refinement, nullptr, PriorsOf(result.changed));
    for (const auto& [id, before] : links) DropContradicted(id, before, &result);
    return result;
  }

  // A view whose links mostly turned out wrong was placed wrongly: with it goes what it brought in.
  static void DropContradicted(int id, int links_before, Refinement* result) {
    constexpr int kEnough = 6;  // Fewer say nothing.
    const int view = IndexOfView(result->changed, id);
    if (view <= 0 || links_before < kEnough || 2 * SharedPoints(result->changed, view) >= links_before) return;
    result->changed.views.erase(result->changed.views.begin() + view);
    DropUnusedPoints(&result->changed);
    ++result->dropped;
  }
};

}  // namespace

Refinement Refiner::RefineAll(const std::shared_ptr<const model::ObjectModel>& object,
                              const std::map<int, pose::PosePrior>& priors) const {
  RefinementParams thorough = params_.refinement;  // Nobody waits for it.
  thorough.related_views *= 2;
  thorough.surface_samples *= 2;
  Refinement result;
  result.base = object;
  result.changed = Refined(*object, 1, thorough, nullptr, Job{object, {}, {}, priors, params_}.PriorsOf(*object));
  return result;
}

void Refiner::Start(std::int64_t frame, const std::shared_ptr<const model::ObjectModel>& object,
                    const std::vector<PointStatistics>& statistics, const std::map<int, pose::PosePrior>& priors) {
  job_.Start(frame + params_.refine_delay_frames,
             [job = Job{object, std::move(new_views_), statistics, priors, params_}] { return job.Run(); });
  new_views_.clear();
}

}  // namespace vantage::learning
