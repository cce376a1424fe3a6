#include "assessor/node.h"

#include <algorithm>
#include <filesystem>
#include <stdexcept>
#include <vantage/answer_t.hpp>

#include "common/params.h"
#include "messaging/channels.h"
#include "messaging/geometry_messages.h"

namespace vantage::assessor {
namespace {

WorkerParams MakeWorkerParams(const AssessorNodeParams& params) {
  WorkerParams worker;
  worker.store = params.store;
  worker.recogniser = params.recogniser;
  worker.trials = params.trials;
  worker.plane = params.plane;
  worker.clusters = params.clusters;
  worker.max_backgrounds = params.max_backgrounds;
  worker.niceness = params.niceness;
  return worker;
}

}  // namespace

void AssessorNodeParams::Check() const {
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(what);
  };
  require(!store.empty(), "store must not be empty");
  measures::CompletenessRuleFromString(rule);
  require(azimuth_cells >= 1 && azimuth_cells <= 360, "azimuth_cells must be in 1..360");
  require(elevation_cells >= 1 && elevation_cells <= 180, "elevation_cells must be in 1..180");
  require(min_elevation_rad < max_elevation_rad, "min_elevation_rad must be < max_elevation_rad");
  require(std::all_of(distances_m.begin(), distances_m.end(), [](double distance) { return distance > 0.0; }),
          "distances_m must be > 0");
  require(publish_period_s > 0.0, "publish_period_s must be > 0");
  require(retry_period_s > 0.0, "retry_period_s must be > 0");
  require(max_backgrounds >= 0, "max_backgrounds must be >= 0");
  require(niceness >= 0 && niceness <= 19, "niceness must be in 0..19");
  require(job_frames >= 0, "job_frames must be >= 0");
  recogniser.Check();
  trials.Check();
}

AssessorNodeParams LoadAssessorNodeParams(const std::string& config_file, const std::string& library_file) {
  AssessorNodeParams params;
  if (!library_file.empty()) {
    const auto library = params::LoadLibraryParams(library_file);
    params.recogniser = library.recogniser;
    params.trials = library.trials;
    params.plane = library.learner.plane;
    params.clusters = library.learner.clusters;
  }
  if (config_file.empty()) return params;
  auto yaml = config::Mapping::Load(config_file);
  yaml.Get("store", params.store);
  yaml.Get("rule", params.rule);
  yaml.Get("azimuth_cells", params.azimuth_cells);
  yaml.Get("elevation_cells", params.elevation_cells);
  yaml.Get("min_elevation_rad", params.min_elevation_rad);
  yaml.Get("max_elevation_rad", params.max_elevation_rad);
  yaml.Get("distances_m", params.distances_m);
  yaml.Get("publish_period_s", params.publish_period_s);
  yaml.Get("retry_period_s", params.retry_period_s);
  yaml.Get("max_backgrounds", params.max_backgrounds);
  yaml.Get("niceness", params.niceness);
  yaml.Get("job_frames", params.job_frames);
  yaml.Finish();
  yaml.Check(params);
  return params;
}

AssessorNode::AssessorNode(messaging::Bus& bus, const AssessorNodeParams& params)
    : Node(bus, "assessor"),
      params_((params.Check(), params)),
      rule_(measures::CompletenessRuleFromString(params.rule)),
      frames_(bus),
      worker_(MakeWorkerParams(params)) {
  SubscribeInOrder<track_t>(messaging::kLearnerTrack, [this](const track_t& message) { OnTrack(message); });
  SubscribeInOrder<view_t>(messaging::kLearnerView, [this](const view_t& message) { OnView(message); });
  Subscribe<reach_t>(messaging::kPlannerReach, [this](const reach_t& message) { OnReach(message); });
  Subscribe<query_t>(messaging::kAssessorQuery, [this](const query_t& message) { OnQuery(message); });
}

std::int64_t AssessorNode::NextStep_us() const {
  return params_.job_frames == 0 && worker_.busy() ? std::min(next_publish_us_, now_us() + 50000) : next_publish_us_;
}

std::string AssessorNode::State() const { return Busy() ? "assessing" : "idle"; }

std::string AssessorNode::Detail() const {
  const auto object = objects_.find(current_);
  if (object == objects_.end()) return "";
  std::string text = current_ + ": " + std::to_string(object->second.assessed_views) + " of " +
                     std::to_string(object->second.views) + " views assessed";
  if (params_.job_frames == 0 && worker_.busy())
    text += ", " + std::to_string(static_cast<int>(100.0 * worker_.progress())) + " % of the trials";
  return text;
}

void AssessorNode::OnTrack(const track_t& message) {
  const auto track = messaging::FromMessage(message);
  if (!track) return Refuse(messaging::kLearnerTrack, track.error);
  if (track->object.empty()) return;
  current_ = track->object;
  Object& object = objects_[current_];
  // The learner tells of a view before it is durable: only what was there before counts.
  object.views = track->views - (track->result.view_added ? 1 : 0);
  if (track->T_world_object) object.T_world_object = track->T_world_object;
}

void AssessorNode::OnView(const view_t& message) {
  const auto view = messaging::FromMessage(message);
  if (!view) return Refuse(messaging::kLearnerView, view.error);
  current_ = view->object;
  Object& object = objects_[current_];
  object.views = view->views;
  object.utime = view->utime;
  if (static_cast<int>(object.viewpoints.size()) + 1 == view->views) object.viewpoints.push_back(view->viewpoint);
  next_publish_us_ = 0;
}

void AssessorNode::OnReach(const reach_t& message) {
  const auto reach = messaging::FromMessage(message);
  if (!reach) return Refuse(messaging::kPlannerReach, reach.error);
  objects_[reach->object].reach = reach->viewpoints;
}

void AssessorNode::OnQuery(const query_t& message) {
  answer_t answer;
  answer.utime = now_us();
  answer.query_id = message.query_id;
  answer.object = message.object;
  answer.known = false;
  answer.probability = 0.0;
  const auto T_frame_camera = messaging::FromMessage(message.T_frame_camera);
  const auto object = objects_.find(message.object);
  if (!T_frame_camera) {
    answer.error = T_frame_camera.error;
  } else if (object == objects_.end() || object->second.viewpoints.empty()) {
    answer.error = "object '" + message.object + "' is not known here";
  } else if (message.frame != query_t::FRAME_OBJECT && message.frame != query_t::FRAME_WORLD) {
    answer.error = "frame " + std::to_string(message.frame) + " is unknown";
  } else if (message.frame == query_t::FRAME_WORLD && !object->second.T_world_object) {
    answer.error = "where '" + message.object + "' stands in the world is not known";
  } else {
    const Object& known = object->second;
    geometry::Rigid T_object_camera = *T_frame_camera;
    if (message.frame == query_t::FRAME_WORLD) T_object_camera = known.T_world_object->inverse() * T_object_camera;
    const double distance_m = T_object_camera.translation().norm();
    if (distance_m > 0.01) {
      const measures::Viewpoint viewpoint{T_object_camera.translation() / distance_m, distance_m};
      answer.known = true;
      answer.probability = measures::DetectionProbability(known.viewpoints, viewpoint, known.measures.predicted, rule_);
      answer.source = measures::ToString(known.measures.predicted.source());
    } else {
      answer.error = "the camera would be inside the object";
    }
  }
  Count("answers");
  bus_.Publish(messaging::kAssessorAnswer, answer);
}

void AssessorNode::Step() {
  CountFrames(frames_);
  if (const auto assessment = TakeAssessment()) OnAssessment(*assessment);
  if (!Busy()) StartNextJob();
  if (now_us() < next_publish_us_) return;
  next_publish_us_ = now_us() + static_cast<std::int64_t>(params_.publish_period_s * 1e6);
  const auto object = objects_.find(current_);
  if (object != objects_.end() && !object->second.viewpoints.empty()) Publish(object->first, object->second);
}

std::map<std::string, AssessorNode::Object>::iterator AssessorNode::NextObject() {
  auto unfinished = objects_.end();
  for (auto object = objects_.begin(); object != objects_.end(); ++object) {
    const Object& known = object->second;
    if (known.views == 0 || now_us() < known.not_before_us) continue;
    if (known.views > known.assessed_views) return object;
    if (!known.finished && unfinished == objects_.end()) unfinished = object;
  }
  return unfinished;
}

void AssessorNode::StartNextJob() {
  const auto next = NextObject();
  if (next == objects_.end()) return;
  auto& [name, object] = *next;
  if (!std::filesystem::exists(params_.store)) {
    NoteError("the learner has views of '" + name + "', but there is no store " + params_.store + ": give both the same --store");
    object.not_before_us = now_us() + static_cast<std::int64_t>(params_.retry_period_s * 1e6);
    return;
  }
  auto received = frames_.Take();
  worker_.Start(name, received ? std::optional<rgbd::Frame>(std::move(received->frame)) : std::nullopt);
  if (params_.job_frames > 0) {
    job_under_way_ = true;
    job_effect_frame_ = frames_.frames() + params_.job_frames;
    worker_.WaitUntilRead();  // The learner may write the next view at any time.
  }
}

std::optional<Assessment> AssessorNode::TakeAssessment() {
  if (params_.job_frames == 0) return worker_.Poll();
  if (!job_under_way_ || frames_.frames() < job_effect_frame_) return std::nullopt;
  job_under_way_ = false;
  worker_.WaitUntilDone();
  return worker_.Poll();
}

void AssessorNode::OnAssessment(const Assessment& assessment) {
  Object& object = objects_[assessment.object];
  if (!assessment.error.empty()) {
    NoteError(assessment.error);
    object.not_before_us = now_us() + static_cast<std::int64_t>(params_.retry_period_s * 1e6);
    return;
  }
  object.measures = assessment.measures;
  object.assessed_views = assessment.assessed_views;
  object.finished = assessment.finished;
  object.views = static_cast<int>(assessment.views.size());
  // Views may have come in meanwhile: theirs stay.
  if (assessment.utime >= object.utime) {
    object.viewpoints = assessment.views;
    object.utime = assessment.utime;
  }
  Count("assessments");
  next_publish_us_ = 0;
}

double AssessorNode::CompletenessOf(const Object& object) const {
  auto queries = object.reach;
  if (queries.empty()) {
    const std::vector<double> as_learned = {assessment::MedianDistance(object.viewpoints)};
    queries = assessment::UniformViewpoints(params_.min_elevation_rad, params_.max_elevation_rad,
                                            params_.distances_m.empty() ? as_learned : params_.distances_m);
  }
  return measures::Completeness(object.viewpoints, queries, object.measures.predicted, rule_);
}

void AssessorNode::Publish(const std::string& name, const Object& object) {
  messaging::ObjectCompleteness completeness;
  completeness.utime = object.utime;
  completeness.object = name;
  completeness.rule = rule_;
  completeness.completeness = CompletenessOf(object);
  completeness.reach_known = !object.reach.empty();
  completeness.distance_m = assessment::MedianDistance(object.viewpoints);
  completeness.sphere = geometry::ViewSphere(params_.azimuth_cells, params_.elevation_cells);
  for (int cell = 0; cell < completeness.sphere.size(); ++cell) {
    const measures::Viewpoint query{completeness.sphere.Direction(cell), completeness.distance_m};
    completeness.cells.push_back(measures::DetectionProbability(object.viewpoints, query, object.measures.predicted, rule_));
  }
  completeness.views = object.viewpoints;
  bus_.Publish(messaging::kAssessorCompleteness, messaging::ToMessage(completeness));

  if (object.assessed_views == 0) return;
  messaging::ObjectMeasures measures;
  measures.utime = object.utime;
  measures.object = name;
  measures.views = object.assessed_views;
  measures.measures = object.measures;
  measures.completeness = completeness.completeness;
  bus_.Publish(messaging::kAssessorMeasures, messaging::ToMessage(measures));
}

}  // namespace vantage::assessor
