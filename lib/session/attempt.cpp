#include "session/attempt.h"

namespace vantage::session {

void NoteFrame(const learning::LearnerResult& seen, const LearnerWants& wants, exploration::Attempt& attempt) {
  const bool detected = seen.state == learning::State::kTracking && seen.probability >= wants.min_track_probability;
  attempt.detected |= detected;
  attempt.well_known |= detected && seen.confidence.value >= wants.new_view_confidence;
}

}  // namespace vantage::session
