#include "recogniser/node.h"

#include <filesystem>
#include <stdexcept>
#include <vantage/object_prior_t.hpp>

#include "common/params.h"
#include "messaging/channels.h"

namespace vantage::recogniser {

void RecogniserNodeParams::Check() const {
  if (store.empty()) throw std::invalid_argument("store must not be empty");
  if (!(max_rate_hz > 0.0)) throw std::invalid_argument("max_rate_hz must be > 0");
  if (!(reload_period_s > 0.0)) throw std::invalid_argument("reload_period_s must be > 0");
  recogniser.Check();
}

RecogniserNodeParams LoadRecogniserNodeParams(const std::string& config_file, const std::string& library_file) {
  RecogniserNodeParams params;
  if (!library_file.empty()) params.recogniser = params::LoadLibraryParams(library_file).recogniser;
  if (config_file.empty()) return params;
  auto yaml = config::Mapping::Load(config_file);
  yaml.Get("store", params.store);
  yaml.Get("max_rate_hz", params.max_rate_hz);
  yaml.Get("reload_period_s", params.reload_period_s);
  yaml.Finish();
  yaml.Check(params);
  return params;
}

RecogniserNode::RecogniserNode(messaging::Bus& bus, const RecogniserNodeParams& params)
    : Node(bus, "recogniser"), params_((params.Check(), params)), frames_(bus), recogniser_(params.recogniser) {
  Subscribe<view_t>(messaging::kLearnerView, [this](const view_t&) { next_reload_us_ = 0; });
  Subscribe<object_prior_t>(messaging::kObjectPrior, [this](const object_prior_t& message) {
    if (!(message.probability > 0.0 && message.probability < 1.0)) {
      return Refuse(messaging::kObjectPrior, "a prior must be in (0, 1), is " + std::to_string(message.probability));
    }
    priors_[message.object] = message.probability;
  });
}

std::string RecogniserNode::Detail() const { return std::to_string(recogniser_.size()) + " objects of " + params_.store; }

void RecogniserNode::Reload() {
  if (!store_) {
    if (!std::filesystem::exists(params_.store)) return;  // Nothing was learned yet.
    store_.emplace(params_.store, model::Store::Mode::kRead);
  }
  std::map<std::string, std::int64_t> gone = revisions_;
  for (const auto& summary : store_->List()) {
    gone.erase(summary.name);
    const auto known = revisions_.find(summary.name);
    if (known != revisions_.end() && known->second == summary.revision) continue;
    revisions_[summary.name] = summary.revision;
    try {
      auto object = store_->Load(summary.name);
      if (object) {
        const std::string mismatch = recognition::MeasuresMismatch(*object, recogniser_.params());
        if (!mismatch.empty()) NoteError(params_.store + ": " + mismatch);
        recogniser_.Set(std::make_shared<const model::ObjectModel>(std::move(*object)));
      }
      Count("reloads");
    } catch (const std::exception& error) {
      NoteError(params_.store + ": object '" + summary.name + "' is left out: " + error.what());
    }
  }
  for (const auto& [name, revision] : gone) {
    recogniser_.Remove(name);
    revisions_.erase(name);
  }
}

void RecogniserNode::Step() {
  CountFrames(frames_);
  if (now_us() >= next_reload_us_) {
    next_reload_us_ = now_us() + static_cast<std::int64_t>(params_.reload_period_s * 1e6);
    Reload();
  }
  if (now_us() < next_frame_us_) return;
  if (const auto received = frames_.Take()) {
    next_frame_us_ = now_us() + static_cast<std::int64_t>(1e6 / params_.max_rate_hz);
    Recognise(*received);
  }
}

void RecogniserNode::Recognise(const messaging::ReceivedFrame& received) {
  const messaging::Stopwatch stopwatch(bus_);
  messaging::FrameDetections detections;
  detections.utime = received.frame.utime;
  detections.sequence = received.sequence;
  detections.objects = recogniser_.size();
  if (recogniser_.size() > 0) {
    const auto features = recogniser_.Extract(received.frame);
    detections.detections = recogniser_.Recognise(received.frame, features, {priors_.begin(), priors_.end()});
  }
  detections.process_ms = stopwatch.ms();
  Count("frames");
  Count("detections", static_cast<std::int64_t>(detections.detections.size()));
  PublishDerived(messaging::kRecogniserDetections, messaging::ToMessage(detections));
}

}  // namespace vantage::recogniser
