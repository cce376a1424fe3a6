// What the learner and the recogniser say, on the wire.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vantage/detections_t.hpp>
#include <vantage/scene_t.hpp>
#include <vantage/track_t.hpp>
#include <vantage/view_t.hpp>
#include <vector>

#include "learning/learner.h"
#include "messaging/result.h"
#include "motion/obstacles.h"

namespace vantage::messaging {

// What the learner made of one frame.
struct Track {
  std::int64_t utime = 0;     // Capture time of the frame.
  std::int64_t sequence = 0;  // Of the frame.
  std::string object;
  learning::LearnerResult result;
  std::optional<geometry::Rigid> T_world_object;
  int views = 0;   // Of the object, after this frame.
  int points = 0;  // Likewise.
  double process_ms = 0.0;
};
track_t ToMessage(const Track& track);
// Refuses poses and probabilities out of range and unknown states.
Result<Track> FromMessage(const track_t& message);

// The table and what stands on it, in the world.
struct Scene {
  std::int64_t utime = 0;  // Capture time of the newest frame in it.
  std::string object;
  std::optional<segmentation::Plane> plane;  // World coordinates, normal up.
  std::vector<motion::HullObstacle> hulls;
};
scene_t ToMessage(const Scene& scene);
// Refuses points that are not finite and normals that are not of unit length.
Result<Scene> FromMessage(const scene_t& message);

// A view that was added to the store.
struct AddedView {
  std::int64_t utime = 0;  // Capture time.
  std::int64_t frame_id = 0;
  std::string object;
  int view_id = 0;
  int views = 0;
  int points = 0;
  int features = 0;
  geometry::Rigid T_camera_object = geometry::Rigid::Identity();
  measures::Viewpoint viewpoint;
  std::string store;
};
// The newest view of the model.
AddedView NewestView(const model::ObjectModel& object, const std::string& store);
view_t ToMessage(const AddedView& view);
Result<AddedView> FromMessage(const view_t& message);

struct FrameDetections {
  std::int64_t utime = 0;     // Capture time of the frame.
  std::int64_t sequence = 0;  // Of the frame.
  int objects = 0;            // Looked for.
  double process_ms = 0.0;
  std::vector<recognition::Detection> detections;  // Inlier pixels are not sent.
};
detections_t ToMessage(const FrameDetections& detections);
Result<FrameDetections> FromMessage(const detections_t& message);

}  // namespace vantage::messaging
