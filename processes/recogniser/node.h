// The recogniser: finds every object of the store in the newest frame.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>

#include "messaging/frame_link.h"
#include "messaging/learner_messages.h"
#include "messaging/node.h"
#include "model/store.h"
#include "recognition/recogniser.h"

namespace vantage::recogniser {

struct RecogniserNodeParams {
  std::string store = "models.db";  // File, only read; it may appear later.
  double max_rate_hz = 1.0;         // Frames looked at per second at most; > 0.
  double reload_period_s = 2.0;     // The store is looked into so often, beside every LEARNER_VIEW; > 0.
  recognition::RecogniserParams recogniser;

  void Check() const;  // Throws std::invalid_argument naming the field.
};

// `config_file`: the fields above but `recogniser`, which is in `library_file`. Either may be empty. Throws std::runtime_error.
RecogniserNodeParams LoadRecogniserNodeParams(const std::string& config_file, const std::string& library_file);

class RecogniserNode : public messaging::Node {
 public:
  RecogniserNode(messaging::Bus& bus, const RecogniserNodeParams& params);

  void Step() override;
  std::int64_t NextStep_us() const override { return frames_.HasNew() ? next_frame_us_ : next_reload_us_; }
  int objects() const { return recogniser_.size(); }

 protected:
  std::string State() const override { return recogniser_.size() > 0 ? "recognising" : "empty"; }
  std::string Detail() const override;

 private:
  void Reload();
  void Recognise(const messaging::ReceivedFrame& received);

  RecogniserNodeParams params_;
  messaging::FrameReceiver frames_;
  recognition::Recogniser recogniser_;
  std::optional<model::Store> store_;
  std::map<std::string, std::int64_t> revisions_;  // Of what is loaded, also of what could not be.
  std::map<std::string, double> priors_;
  std::int64_t next_reload_us_ = 0;
  std::int64_t next_frame_us_ = 0;
};

}  // namespace vantage::recogniser
