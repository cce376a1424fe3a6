// Runs the virtual trials of an object on a thread of its own, so that the assessor stays responsive.
#pragma once

#include <atomic>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "assessment/assessor.h"
#include "model/store.h"
#include "rgbd/frame.h"
#include "segmentation/clusters.h"
#include "segmentation/plane.h"

namespace vantage::assessor {

struct WorkerParams {
  std::string store;
  recognition::RecogniserParams recogniser;
  assessment::TrialParams trials;
  segmentation::PlaneParams plane;  // To find what is background in the run's own frames.
  segmentation::ClusterParams clusters;
  int max_backgrounds = 8;  // >= 0.
  int max_lookalikes = 4;   // Other objects of the store that must not be taken for the one at hand, as they look on a table; >= 0.
  int niceness = 5;         // Of the thread: sensor and learner go first; 0..19.
};

// What became of one job.
struct Assessment {
  std::string object;
  std::string error;                       // Empty where it worked; then:
  std::int64_t utime = 0;                  // Capture time of the newest view in the store.
  std::vector<measures::Viewpoint> views;  // In the store.
  int assessed_views = 0;                  // So many of them have had trials.
  bool finished = false;                   // All of them have had all of their trials.
  measures::Measures measures;
  int trials = 0;  // All that the fit is made of.
};

// The thread only computes: it reads the store and touches no bus. Trials that were run are kept, so that a job costs what is new.
class Worker {
 public:
  explicit Worker(const WorkerParams& params);
  ~Worker();  // Breaks off what is under way; returns within one trial.
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  // One part of the trials of a view: of the first view of the object that has had none yet, so that a new view soon counts; else
  // of the first that has not had all. `frame`: a background is cut from it; may be empty. Not while busy.
  void Start(const std::string& object, std::optional<rgbd::Frame> frame);
  bool busy() const { return busy_; }
  double progress() const { return progress_; }  // Of the job under way, [0, 1].
  // The result, once.
  std::optional<Assessment> Poll();
  // Cut from the frames so far. Not while busy.
  const std::vector<assessment::Background>& backgrounds() const { return backgrounds_; }
  // For lock step: waits until the job under way has read the store, and until it is done.
  void WaitUntilRead();
  void WaitUntilDone();

 private:
  struct ViewTrials {
    std::vector<assessment::Trial> trials;
    int parts = 0;  // That were run.
  };
  struct Known {
    std::shared_ptr<const model::ObjectModel> model;  // As last read from the store.
    std::map<int, ViewTrials> trials;                 // By the id of the view that was offered.
  };

  void Run();
  Assessment Assess(const std::string& object, const std::optional<rgbd::Frame>& frame);
  // Reads the store; trials of views that are no more are forgotten.
  Known& Read(const model::Store& store, const std::string& object);
  // The view whose turn it is; null when all are done.
  static const model::View* Next(const Known& known);
  void AddBackground(const rgbd::Frame& frame);
  // Of the store's other objects, each once and as it is then, in the first background.
  void AddLookAlikes(const model::Store& store, const std::string& object);
  assessment::Background WithFeatures(const cv::Mat& color) const;

  WorkerParams params_;
  std::map<std::string, Known> known_;                        // The thread's own.
  std::vector<assessment::Background> backgrounds_;           // Likewise; they show no objects.
  std::map<std::string, assessment::Background> lookalikes_;  // Likewise, but the object of that name.

  std::mutex mutex_;
  std::condition_variable wake_;
  std::optional<std::string> job_;
  std::optional<rgbd::Frame> job_frame_;
  std::optional<Assessment> result_;
  bool reading_ = false;             // The job has not read the store yet.
  std::condition_variable changed_;  // reading_ or busy_ is.
  std::atomic<bool> busy_{false};
  std::atomic<bool> stop_{false};
  std::atomic<double> progress_{0.0};
  std::thread thread_;
};

}  // namespace vantage::assessor
