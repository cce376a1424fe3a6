// Which rule of completeness is right: models of random views, judged on photographs, with measures fitted on other photographs.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "assessment/held_out.h"
#include "common/params.h"
#include "vantage/verb.h"

namespace vantage::cli {

struct CompletenessOptions {
  std::string folder;  // A recording with depth, labels and truth.
  int object_id = 0;
  std::string frames = "all";  // As rgbd::SelectFrames.
  std::vector<int> views = {1, 2, 4, 8, 16};
  int splits = 30;  // Of the frames, at random: a third is learned from, one measures are fitted on, one judges.
  std::uint32_t seed = 0;
};

// Models of one number of views, one for each split that has so many.
struct CompletenessFigures {
  int views = 0;
  std::vector<std::vector<measures::JointSample>> looks;  // By split: every judged frame.
  std::vector<double> common_cause;                       // By split: as fitted.

  double DetectionRate() const;
  double Predicted(measures::CompletenessRule rule) const;
  double DifferenceSd(measures::CompletenessRule rule) const;  // Of predicted - detected, over splits.
  double BrierScore(measures::CompletenessRule rule) const;    // Of single looks.
};

// Throws std::runtime_error where the recording lacks what is needed. `progress` after every split.
std::vector<CompletenessFigures> TryCompleteness(const CompletenessOptions& options, const params::LibraryParams& params,
                                                 const std::function<void(int done, int of)>& progress = {});

// The share of failures that come to all views at once which explains all looks of several views best, whatever the model.
double PooledCommonCause(const std::vector<CompletenessFigures>& figures);

Json ToJson(const std::vector<CompletenessFigures>& figures);
std::string TableOf(const std::vector<CompletenessFigures>& figures);

}  // namespace vantage::cli
