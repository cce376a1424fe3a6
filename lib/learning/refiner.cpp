#include "learning/refiner.h"

#include <algorithm>

namespace vantage::learning {
namespace {

int IndexOfView(const model::ObjectModel& object, int id) {
  for (size_t i = 0; i < object.views.size(); ++i) {
    if (object.views[i].id == id) return static_cast<int>(i);
  }
  return -1;
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
    for (const int id : new_views) {
      const int view = IndexOfView(result.changed, id);
      if (view < 0) continue;
      auto closed = WithLoopClosed(result.changed, view, params.loop_closure, params.refinement);
      if (!closed) continue;
      result.changed = std::move(*closed);
      ++result.closures;
    }
    // A closed loop moves everything, else it is the newest views that are not settled yet.
    const int views = static_cast<int>(result.changed.views.size());
    const int first_free = result.closures > 0 ? 1 : std::max(1, views - params.refined_views);
    result.changed = Refined(result.changed, first_free, params.refinement, nullptr, PriorsOf(result.changed));
    return result;
  }
};

}  // namespace

void Refiner::StartIfDue(std::int64_t frame, const std::shared_ptr<const model::ObjectModel>& object,
                         const std::vector<PointStatistics>& statistics, const std::map<int, pose::PosePrior>& priors) {
  if (new_views_.empty() || job_.busy()) return;
  job_.Start(frame + params_.refine_delay_frames,
             [job = Job{object, std::move(new_views_), statistics, priors, params_}] { return job.Run(); });
  new_views_.clear();
}

}  // namespace vantage::learning
