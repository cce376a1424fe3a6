// Which frames become views of the model (section III): decisions only, nothing is changed here.
#pragma once

#include <string>

#include "learning/params.h"
#include "learning/tracker.h"
#include "model/object_model.h"

namespace vantage::learning {

// A frame the object is surely tracked in.
struct Sighting {
  const Track& track;
  bool continued = false;          // Where the last frames led, and its surface is measured there.
  bool agrees_with_mount = false;  // The mount says the same.
  bool pose_is_known = false;      // Told, not tracked: held and right whatever the images say.
};

// How well a pose must be held to be learned from.
enum class Hold {
  kNone,
  kPlain,  // Followed to where the surface shows, less well than is wanted: enough not to lose a plain object.
  kFirm,
};
Hold HoldOf(const Sighting& sighting, const LearnerParams& params);

// Whether it is seen from elsewhere than every view of it. The less of the object is recognised, the nearer to a learned view a new
// one may be, if it is held firmly. Cost: linear in views.
bool IsNewDirection(const model::ObjectModel& object, const Track& track, Hold hold, const LearnerParams& params);

// Whether the frame shows both what was learned last and, without the model knowing that they meet, something learned long
// before: a view of it ties them together.
bool ClosesLoop(const model::ObjectModel& object, const Track& track, const LearnerParams& params);

struct ViewChoice {
  std::string refusal;  // Why not, in a few words; empty where a view is wanted...
  int min_points = 0;   // ...of at least so many interest points with depth.
};

// All of it: a view is wanted where the object is not well known from here (c below new_view_confidence) or a loop closes, the
// pose is sure and held, and the direction is new. A known pose asks for the first alone.
ViewChoice ChooseView(const model::ObjectModel& object, const Sighting& sighting, const LearnerParams& params);

}  // namespace vantage::learning
