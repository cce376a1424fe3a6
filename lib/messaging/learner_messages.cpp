#include "messaging/learner_messages.h"

#include <cmath>
#include <stdexcept>

#include "messaging/assessor_messages.h"
#include "messaging/geometry_messages.h"

namespace vantage::messaging {
namespace {

std::optional<learning::State> StateFromString(const std::string& text) {
  for (const auto state :
       {learning::State::kSearching, learning::State::kTracking, learning::State::kLost, learning::State::kRelocalising}) {
    if (learning::ToString(state) == text) return state;
  }
  return std::nullopt;
}

// Fills `pose` where the message has one; returns what is wrong with it.
std::string OptionalPose(bool known, const pose_t& message, std::optional<geometry::Rigid>& pose) {
  pose.reset();
  if (!known) return "";
  const auto value = FromMessage(message);
  if (value) pose = *value;
  return value.error;
}

}  // namespace

track_t ToMessage(const Track& track) {
  const learning::LearnerResult& result = track.result;
  track_t message;
  message.utime = track.utime;
  message.sequence = track.sequence;
  message.object = track.object;
  message.state = learning::ToString(result.state);
  message.tracked = result.T_camera_object.has_value();
  message.T_camera_object = ToMessage(result.T_camera_object.value_or(geometry::Rigid::Identity()));
  message.T_world_object_known = track.T_world_object.has_value();
  message.T_world_object = ToMessage(track.T_world_object.value_or(geometry::Rigid::Identity()));
  message.confidence = result.confidence.value;
  message.support = result.confidence.support;
  message.visible = result.confidence.visible;
  message.probability = result.probability;
  message.reference_view = result.reference_view;
  message.inliers = result.inliers;
  message.view_added = result.view_added;
  message.views = track.views;
  message.points = track.points;
  message.process_ms = track.process_ms;
  message.note = result.note;
  return message;
}

Result<Track> FromMessage(const track_t& message) {
  Track track;
  const auto state = StateFromString(message.state);
  if (!state) return Result<Track>::Error("state '" + message.state + "' is unknown");
  if (!IsProbability(message.confidence) || !IsProbability(message.probability)) {
    return Result<Track>::Error("a confidence or probability outside [0, 1]");
  }
  if (message.views < 0 || message.points < 0) return Result<Track>::Error("a negative number of views or points");
  for (const auto& error : {OptionalPose(message.tracked, message.T_camera_object, track.result.T_camera_object),
                            OptionalPose(message.T_world_object_known, message.T_world_object, track.T_world_object)}) {
    if (!error.empty()) return Result<Track>::Error(error);
  }
  track.utime = message.utime;
  track.sequence = message.sequence;
  track.object = message.object;
  track.result.state = *state;
  track.result.confidence = {message.confidence, message.reference_view, message.support, message.visible};
  track.result.probability = message.probability;
  track.result.reference_view = message.reference_view;
  track.result.inliers = message.inliers;
  track.result.view_added = message.view_added != 0;
  track.result.note = message.note;
  track.views = message.views;
  track.points = message.points;
  track.process_ms = message.process_ms;
  return track;
}

scene_t ToMessage(const Scene& scene) {
  scene_t message;
  message.utime = scene.utime;
  message.object = scene.object;
  message.plane_known = scene.plane.has_value();
  const segmentation::Plane plane = scene.plane.value_or(segmentation::Plane());
  for (int i = 0; i < 3; ++i) message.plane_normal[i] = plane.normal[i];
  message.plane_offset = plane.offset_m;
  for (const auto& hull : scene.hulls) {
    hull_t entry;
    entry.name = hull.name;
    for (const auto& point : hull.points_in_world) entry.points.push_back({point.x(), point.y(), point.z()});
    entry.count = static_cast<std::int16_t>(entry.points.size());
    message.hulls.push_back(entry);
  }
  message.count = static_cast<std::int16_t>(message.hulls.size());
  return message;
}

Result<Scene> FromMessage(const scene_t& message) {
  Scene scene;
  scene.utime = message.utime;
  scene.object = message.object;
  if (message.plane_known) {
    segmentation::Plane plane;
    plane.normal = {message.plane_normal[0], message.plane_normal[1], message.plane_normal[2]};
    plane.offset_m = message.plane_offset;
    if (!plane.normal.allFinite() || std::abs(plane.normal.norm() - 1.0) > 0.01 || !std::isfinite(plane.offset_m)) {
      return Result<Scene>::Error("a table plane that is out of range");
    }
    scene.plane = plane;
  }
  for (const auto& entry : message.hulls) {
    motion::HullObstacle hull;
    hull.name = entry.name;
    for (const auto& point : entry.points) {
      hull.points_in_world.emplace_back(point[0], point[1], point[2]);
      if (!hull.points_in_world.back().allFinite()) return Result<Scene>::Error("a hull point that is not finite");
    }
    if (hull.points_in_world.size() < 4) return Result<Scene>::Error("a hull of fewer than 4 points");
    scene.hulls.push_back(std::move(hull));
  }
  return scene;
}

AddedView NewestView(const model::ObjectModel& object, const std::string& store) {
  const model::View& newest = object.views.back();
  AddedView view;
  view.utime = newest.utime;
  view.frame_id = newest.frame_id;
  view.object = object.name;
  view.view_id = newest.id;
  view.views = static_cast<int>(object.views.size());
  view.points = static_cast<int>(object.points.size());
  view.features = newest.features.size();
  view.T_camera_object = newest.T_camera_object;
  view.viewpoint = newest.viewpoint();
  view.store = store;
  return view;
}

view_t ToMessage(const AddedView& view) {
  view_t message;
  message.utime = view.utime;
  message.frame_id = view.frame_id;
  message.object = view.object;
  message.view_id = view.view_id;
  message.views = view.views;
  message.points = view.points;
  message.features = view.features;
  message.T_camera_object = ToMessage(view.T_camera_object);
  message.viewpoint = ToMessage(view.viewpoint);
  message.store = view.store;
  return message;
}

Result<AddedView> FromMessage(const view_t& message) {
  const auto pose = FromMessage(message.T_camera_object);
  if (!pose) return Result<AddedView>::Error(pose.error);
  const auto viewpoint = FromMessage(message.viewpoint);
  if (!viewpoint) return Result<AddedView>::Error(viewpoint.error);
  if (message.views < 1 || message.points < 0) return Result<AddedView>::Error("a view of an object without views");
  AddedView view;
  view.utime = message.utime;
  view.frame_id = message.frame_id;
  view.object = message.object;
  view.view_id = message.view_id;
  view.views = message.views;
  view.points = message.points;
  view.features = message.features;
  view.T_camera_object = *pose;
  view.viewpoint = *viewpoint;
  view.store = message.store;
  return view;
}

detections_t ToMessage(const FrameDetections& detections) {
  detections_t message;
  message.utime = detections.utime;
  message.sequence = detections.sequence;
  message.objects = detections.objects;
  message.process_ms = detections.process_ms;
  for (const auto& detection : detections.detections) {
    detection_t entry;
    entry.object = detection.object;
    entry.T_camera_object = ToMessage(detection.T_camera_object);
    entry.confidence = detection.confidence.value;
    entry.support = detection.confidence.support;
    entry.visible = detection.confidence.visible;
    entry.view = detection.confidence.view;
    entry.probability = detection.probability;
    entry.source = measures::ToString(detection.source);
    entry.inliers = detection.inliers;
    message.detections.push_back(entry);
  }
  message.count = static_cast<std::int16_t>(message.detections.size());
  return message;
}

Result<FrameDetections> FromMessage(const detections_t& message) {
  using Detections = Result<FrameDetections>;
  FrameDetections result;
  result.utime = message.utime;
  result.sequence = message.sequence;
  result.objects = message.objects;
  result.process_ms = message.process_ms;
  for (const auto& entry : message.detections) {
    const auto pose = FromMessage(entry.T_camera_object);
    if (!pose) return Detections::Error(entry.object + ": " + pose.error);
    if (!IsProbability(entry.confidence) || !IsProbability(entry.probability)) {
      return Detections::Error(entry.object + ": a confidence or probability outside [0, 1]");
    }
    recognition::Detection detection;
    detection.object = entry.object;
    detection.T_camera_object = *pose;
    detection.confidence = {entry.confidence, entry.view, entry.support, entry.visible};
    detection.probability = entry.probability;
    detection.inliers = entry.inliers;
    try {
      detection.source = measures::SourceFromString(entry.source);
    } catch (const std::invalid_argument& error) {
      return Detections::Error(entry.object + ": " + error.what());
    }
    result.detections.push_back(std::move(detection));
  }
  return result;
}

}  // namespace vantage::messaging
