// The learner: finds an object, tracks it, adds views and keeps the store. Its only writer.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "learning/learner.h"
#include "messaging/assessor_messages.h"
#include "messaging/frame_link.h"
#include "messaging/learner_messages.h"
#include "messaging/node.h"
#include "model/store.h"
#include "session/scene_map.h"

namespace vantage::learner {

struct LearnerNodeParams {
  std::string object = "object";     // What the object is called in the store; one that is there is learned further.
  std::string store = "models.db";   // File; made where there is none.
  std::vector<double> target_pixel;  // [u, v]: the object to learn is the cluster there; empty: the one nearest to the centre.
  double scene_period_s = 1.0;       // LEARNER_SCENE is sent again so often; > 0.
  double max_rate_hz = 5.0;          // Frames looked at per second at most; > 0.
  bool learn_in_motion = false;      // Also frames captured while the mount moves (where there is one) are learned from.
  learning::LearnerParams learner;

  void Check() const;  // Throws std::invalid_argument naming the field.
};

// `config_file`: the fields above but `learner`, which is in `library_file`. Either may be empty. Throws std::runtime_error.
LearnerNodeParams LoadLearnerNodeParams(const std::string& config_file, const std::string& library_file);

class LearnerNode : public messaging::Node {
 public:
  // Opens the store. Throws std::runtime_error where it cannot be written.
  LearnerNode(messaging::Bus& bus, const LearnerNodeParams& params);

  void Step() override;
  std::int64_t NextStep_us() const override;

  const learning::Learner& learner() const { return *learner_; }

 protected:
  std::string State() const override;
  std::string Detail() const override;

 private:
  // "[NAME] [U,V]": learns this object next, going on with what is stored under that name.
  void OnLearn(const std::string& argument);
  void Begin(const std::string& object);
  void OnMeasures(const messaging::ObjectMeasures& measures);
  void Process(const messaging::ReceivedFrame& received);
  // Writes what the store does not hold yet, and tells of a new view on LEARNER_VIEW.
  void StoreViews();
  void NoteScene(const rgbd::Frame& frame, bool view_added);
  void PublishScene();

  LearnerNodeParams params_;
  model::Store store_;
  messaging::FrameReceiver frames_;
  std::unique_ptr<learning::Learner> learner_;
  bool unsaved_ = false;     // The model has changed since it was written.
  int announced_view_ = -1;  // Id of the newest view that was told of.
  session::SceneMap scene_;
  std::int64_t scene_utime_ = 0;
  std::int64_t next_scene_us_ = 0;
  std::int64_t next_frame_us_ = 0;
  messaging::Track last_;
  std::optional<messaging::ObjectMeasures> saved_measures_;
  bool paused_ = false;
  std::int64_t mount_us_ = 0;        // Of the mount's newest state.
  std::int64_t moved_until_us_ = 0;  // The mount was moving at this time and before; no mount: never.
};

}  // namespace vantage::learner
