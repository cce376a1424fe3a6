// What the learner made of the frames of an attempt, as the planner is told: the same by the process and by the loop in lock step.
#pragma once

#include "exploration/planner.h"
#include "learning/learner.h"

namespace vantage::session {

// Thresholds of learning::LearnerParams.
struct LearnerWants {
  double min_track_probability = 0.7;
  double new_view_confidence = 0.6;
};

// Adds what one frame showed. The object is detected where the learner may learn, and well known where it is detected and the
// learner wants no other view of it; another reason to add none ("no cluster where the object is", ...) may be gone next time.
void NoteFrame(const learning::LearnerResult& seen, const LearnerWants& wants, exploration::Attempt& attempt);

}  // namespace vantage::session
