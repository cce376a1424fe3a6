#include "learner/node.h"

#include <algorithm>
#include <cstdio>
#include <sstream>
#include <stdexcept>
#include <vantage/mount_state_t.hpp>
#include <vantage/operator_command_t.hpp>

#include "common/params.h"
#include "messaging/channels.h"
#include "messaging/mount_messages.h"

namespace vantage::learner {
namespace {

std::shared_ptr<const model::ObjectModel> LoadKnown(const model::Store& store, const std::string& name) {
  auto known = store.Load(name);
  return known && !known->views.empty() ? std::make_shared<const model::ObjectModel>(std::move(*known)) : nullptr;
}

bool Same(const messaging::ObjectMeasures& a, const messaging::ObjectMeasures& b) {
  return a.utime == b.utime && a.views == b.views && a.completeness == b.completeness;
}

}  // namespace

void LearnerNodeParams::Check() const {
  if (object.empty()) throw std::invalid_argument("object must not be empty");
  if (store.empty()) throw std::invalid_argument("store must not be empty");
  if (!target_pixel.empty() && target_pixel.size() != 2) throw std::invalid_argument("target_pixel must be [u, v]");
  if (!(scene_period_s > 0.0)) throw std::invalid_argument("scene_period_s must be > 0");
  if (!(max_rate_hz > 0.0)) throw std::invalid_argument("max_rate_hz must be > 0");
  learner.Check();
}

LearnerNodeParams LoadLearnerNodeParams(const std::string& config_file, const std::string& library_file) {
  LearnerNodeParams params;
  if (!library_file.empty()) params.learner = params::LoadLibraryParams(library_file).learner;
  if (config_file.empty()) return params;
  auto yaml = config::Mapping::Load(config_file);
  yaml.Get("object", params.object);
  yaml.Get("store", params.store);
  yaml.Get("target_pixel", params.target_pixel);
  yaml.Get("scene_period_s", params.scene_period_s);
  yaml.Get("max_rate_hz", params.max_rate_hz);
  yaml.Get("learn_in_motion", params.learn_in_motion);
  yaml.Finish();
  yaml.Check(params);
  return params;
}

LearnerNode::LearnerNode(messaging::Bus& bus, const LearnerNodeParams& params)
    : Node(bus, "learner"),
      params_((params.Check(), params)),
      store_(params.store, model::Store::Mode::kWrite),
      frames_(bus),
      next_scene_us_(bus.now_us()) {
  Begin(params_.object);
  Subscribe<measures_t>(messaging::kAssessorMeasures, [this](const measures_t& message) {
    const auto measures = messaging::FromMessage(message);
    if (!measures) return Refuse(messaging::kAssessorMeasures, measures.error);
    OnMeasures(*measures);
  });
  SubscribeInOrder<mount_state_t>(messaging::kMountState, [this](const mount_state_t& message) {
    const auto state = messaging::FromMessage(message);
    if (!state) return Refuse(messaging::kMountState, state.error);
    if (state->utime < mount_us_) moved_until_us_ = 0;  // It was started again, or its clock was set.
    mount_us_ = state->utime;
    if (state->moving) moved_until_us_ = std::max(moved_until_us_, state->utime);
  });
  Subscribe<operator_command_t>(messaging::kOperatorCommand, [this](const operator_command_t& message) {
    if (!message.process.empty() && message.process != process()) return;
    if (message.command == "pause") paused_ = true;
    if (message.command == "resume") paused_ = false;
    if (message.command == "learn") OnLearn(message.argument);
  });
}

void LearnerNode::Begin(const std::string& object) {
  const auto known = LoadKnown(store_, object);
  learner_ = std::make_unique<learning::Learner>(params_.learner, object, known);
  announced_view_ = known ? known->views.back().id : -1;
  last_ = {};
  unsaved_ = false;
  saved_measures_.reset();
  if (known) return;
  std::vector<std::shared_ptr<const model::ObjectModel>> others;
  for (const auto& summary : store_.List()) {
    try {
      if (auto other = LoadKnown(store_, summary.name)) others.push_back(std::move(other));
    } catch (const std::runtime_error& error) {
      NoteError(error.what());  // One that is damaged is left out.
    }
  }
  learner_->SetOthers(others);
}

void LearnerNode::OnLearn(const std::string& argument) {
  std::string object = params_.object;
  std::optional<Eigen::Vector2d> pixel;
  std::istringstream words(argument);
  for (std::string word; words >> word;) {
    double u = 0.0, v = 0.0;
    char end = 0;
    if (std::sscanf(word.c_str(), "%lf,%lf%c", &u, &v, &end) == 2) {
      pixel = Eigen::Vector2d(u, v);
    } else {
      object = word;
    }
  }
  StoreViews();
  Begin(object);
  params_.target_pixel.clear();
  if (pixel) params_.target_pixel = {pixel->x(), pixel->y()};
}

std::int64_t LearnerNode::NextStep_us() const {
  return frames_.HasNew() && !paused_ ? std::min(next_frame_us_, next_scene_us_) : next_scene_us_;
}

std::string LearnerNode::State() const { return paused_ ? "paused" : learning::ToString(last_.result.state); }

std::string LearnerNode::Detail() const {
  return learner_->name() + ", " + std::to_string(last_.views) + " views in " + params_.store;
}

void LearnerNode::OnMeasures(const messaging::ObjectMeasures& measures) {
  if (measures.object != learner_->name() || announced_view_ < 0) return;
  if (saved_measures_ && Same(*saved_measures_, measures)) return;
  if (!measures.measures.fingerprint.empty() && measures.measures.fingerprint != params_.learner.recogniser.Fingerprint()) {
    return Refuse(messaging::kAssessorMeasures,
                  "measures of " + measures.object +
                      " were fitted for other recogniser settings: give learner and assessor the same "
                      "--library file");
  }
  store_.SaveMeasures(measures.object, measures.measures, measures.completeness);
  learner_->SetMeasures(measures.measures);
  saved_measures_ = measures;
  Count("measures");
}

void LearnerNode::Step() {
  CountFrames(frames_);
  if (!paused_ && frames_.HasNew() && now_us() >= next_frame_us_) {
    // Nothing is decoded that is not looked at.
    const bool in_motion = !params_.learn_in_motion && frames_.newest_utime() <= moved_until_us_;
    if (in_motion) {
      frames_.Drop();
    } else if (const auto received = frames_.Take()) {
      next_frame_us_ = now_us() + static_cast<std::int64_t>(1e6 / params_.max_rate_hz);
      Process(*received);
    }
  }
  if (now_us() < next_scene_us_) return;
  next_scene_us_ = now_us() + static_cast<std::int64_t>(params_.scene_period_s * 1e6);
  PublishScene();
}

void LearnerNode::Process(const messaging::ReceivedFrame& received) {
  const messaging::Stopwatch stopwatch(bus_);
  learning::Target target;
  if (params_.target_pixel.size() == 2) target.pixel = Eigen::Vector2d(params_.target_pixel[0], params_.target_pixel[1]);
  last_.result = learner_->Process(received.frame, target);
  last_.process_ms = stopwatch.ms();
  Count("frames");
  if (last_.result.T_camera_object) Count("tracked");

  last_.utime = received.frame.utime;
  last_.sequence = received.sequence;
  last_.object = learner_->name();
  last_.T_world_object = learner_->T_world_object();
  const auto object = learner_->object();
  last_.views = object ? static_cast<int>(object->views.size()) : 0;
  last_.points = object ? static_cast<int>(object->points.size()) : 0;
  unsaved_ |= last_.result.view_added || last_.result.refined;
  NoteScene(received.frame, last_.result.view_added);
  PublishDerived(messaging::kLearnerTrack, messaging::ToMessage(last_));
  StoreViews();
}

void LearnerNode::StoreViews() {
  if (!unsaved_) return;  // Where writing fails it is tried again with the next frame.
  const auto object = learner_->object();
  store_.Update(*object);
  unsaved_ = false;
  const int newest = object->views.back().id;
  if (newest == announced_view_) return;
  announced_view_ = newest;
  Count("views");
  PublishDerived(messaging::kLearnerView, messaging::ToMessage(messaging::NewestView(*object, params_.store)));
}

void LearnerNode::NoteScene(const rgbd::Frame& frame, bool view_added) {
  if (!frame.T_world_camera) return;
  if (view_added && learner_->plane()) {
    scene_.Add(frame, *learner_->plane(), learner_->clusters());
  } else if (scene_.empty() && last_.result.T_camera_object) {
    // Going on with a known object: the learner did not need to segment.
    const auto plane = segmentation::FitPlane(frame, params_.learner.plane);
    if (!plane) return;
    scene_.Add(frame, *plane, segmentation::FindClusters(frame, *plane, params_.learner.clusters));
  } else {
    return;
  }
  scene_utime_ = frame.utime;
  next_scene_us_ = 0;
}

void LearnerNode::PublishScene() {
  if (scene_.empty()) return;
  messaging::Scene scene;
  scene.utime = scene_utime_;
  scene.object = learner_->name();
  scene.plane = scene_.plane_in_world();
  scene.hulls = scene_.hulls();
  bus_.Publish(messaging::kLearnerScene, messaging::ToMessage(scene));
}

}  // namespace vantage::learner
