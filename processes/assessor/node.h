// The assessor: learns how well an object is known from virtual views, and answers how likely it would be detected from elsewhere.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vantage/query_t.hpp>

#include "assessor/worker.h"
#include "messaging/assessor_messages.h"
#include "messaging/frame_link.h"
#include "messaging/learner_messages.h"
#include "messaging/node.h"

namespace vantage::assessor {

struct AssessorNodeParams {
  std::string store = "models.db";    // File, only read; it may appear later.
  std::string rule = "common_cause";  // How the views' probabilities combine: max, common_cause, noisy_or, clipped_sum.
  int azimuth_cells = 36;             // Of the sphere that is published; 1..360.
  int elevation_cells = 18;           // Likewise; 1..180.
  double min_elevation_rad = 0.17;    // Until PLANNER_REACH says what can be seen: the sphere between these...
  double max_elevation_rad = 1.4;     // ...counts, from...
  std::vector<double> distances_m;    // ...these distances, each > 0; empty: from the median distance of the views.
  double publish_period_s = 1.0;      // > 0.
  double retry_period_s = 5.0;        // After an error; > 0.
  int max_backgrounds = 8;            // Of the run's own frames; >= 0.
  int niceness = 5;                   // Of the thread that runs trials; 0..19.
  int job_frames = 0;                 // Trials take effect so many frames after they began, and are waited for where they are not
                                      // done by then: a replay is the same on every run. 0: as soon as they are done.
  recognition::RecogniserParams recogniser;
  assessment::TrialParams trials;
  segmentation::PlaneParams plane;
  segmentation::ClusterParams clusters;

  void Check() const;  // Throws std::invalid_argument naming the field.
};

// `config_file`: the fields above down to niceness; the others are in `library_file`. Either may be empty. Throws
// std::runtime_error.
AssessorNodeParams LoadAssessorNodeParams(const std::string& config_file, const std::string& library_file);

class AssessorNode : public messaging::Node {
 public:
  AssessorNode(messaging::Bus& bus, const AssessorNodeParams& params);

  void Step() override;
  std::int64_t NextStep_us() const override;

 protected:
  std::string State() const override;
  std::string Detail() const override;

 private:
  // What is known of one object.
  struct Object {
    int views = 0;           // In the store, as the learner says.
    int assessed_views = 0;  // Whose trials, some at least, are in the measures.
    bool finished = false;   // All trials of these views are.
    std::int64_t utime = 0;  // Capture time of the newest view.
    std::vector<measures::Viewpoint> viewpoints;
    measures::Measures measures;
    std::vector<measures::WeightedViewpoint> reach;  // Empty: not known.
    std::optional<geometry::Rigid> T_world_object;
    std::int64_t not_before_us = 0;  // Of the next try.
  };

  void OnTrack(const track_t& message);
  void OnView(const view_t& message);
  void OnReach(const reach_t& message);
  void OnQuery(const query_t& message);
  void OnAssessment(const Assessment& assessment);
  // Whose trials go on: an object with views that have had none, so that these soon count; else one with unfinished ones.
  std::map<std::string, Object>::iterator NextObject();
  void StartNextJob();
  // What came of the trials, once they take effect.
  std::optional<Assessment> TakeAssessment();
  bool Busy() const { return params_.job_frames > 0 ? job_under_way_ : worker_.busy(); }
  void Publish(const std::string& name, const Object& object);
  double CompletenessOf(const Object& object) const;

  AssessorNodeParams params_;
  measures::CompletenessRule rule_;
  messaging::FrameReceiver frames_;
  std::map<std::string, Object> objects_;
  std::string current_;  // What the learner is at.
  std::int64_t next_publish_us_ = 0;
  bool job_under_way_ = false;         // For job_frames...
  std::int64_t job_effect_frame_ = 0;  // ...and the frame at which its result is taken.
  Worker worker_;                      // Last: its thread ends first.
};

}  // namespace vantage::assessor
