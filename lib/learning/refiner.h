// Refinement beside tracking: closes loops, adjusts what was learned, tidies it up. It runs on a thread of its own and takes effect
// at a stated frame, so that tracking never waits for it and a replay is the same on every run.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "learning/background.h"
#include "learning/params.h"
#include "model/object_model.h"

namespace vantage::learning {

// What came of one job.
struct Refinement {
  std::shared_ptr<const model::ObjectModel> base;  // What it was made from...
  model::ObjectModel changed;                      // ...and what became of it.
  int closures = 0;                                // Loops that were closed.
  int dropped = 0;                                 // Views that the others contradict.
};

class Refiner {
 public:
  explicit Refiner(const LearnerParams& params) : params_(params) {}

  // This view was added: the next job sees whether it closes a loop.
  void ViewAdded(int view_id) {
    new_views_.push_back(view_id);
    ++views_added_;
  }
  int views_added() const { return views_added_; }  // Since the beginning.

  // Whether views were added since the last job, and none is under way.
  bool IsDue() const { return !new_views_.empty() && !job_.busy(); }
  // Starts a job for them. `statistics`: one per point. `priors`: where the mount says the object is, by view id.
  void Start(std::int64_t frame, const std::shared_ptr<const model::ObjectModel>& object,
             const std::vector<PointStatistics>& statistics, const std::map<int, pose::PosePrior>& priors);

  // The result, at the frame where it takes effect; waits for it where it is not there by then.
  std::optional<Refinement> Take(std::int64_t frame) { return job_.Take(frame); }
  // The result of the job under way, whatever the frame.
  std::optional<Refinement> Finish() { return job_.Finish(); }

  // All views and points together, here and now: views are held against twice as many others as in a job, and more closely.
  Refinement RefineAll(const std::shared_ptr<const model::ObjectModel>& object, const std::map<int, pose::PosePrior>& priors) const;

 private:
  LearnerParams params_;
  std::vector<int> new_views_;  // Ids.
  int views_added_ = 0;
  Background<Refinement> job_;
};

}  // namespace vantage::learning
