#include "assessor/worker.h"

#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <numeric>
#include <stdexcept>

#include "assessment/background.h"

namespace vantage::assessor {
namespace {

constexpr int kParts = 3;  // In which the trials of a view are run.

struct BrokenOff {};

}  // namespace

Worker::Worker(const WorkerParams& params) : params_(params), thread_([this] { Run(); }) {}

Worker::~Worker() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

void Worker::Start(const std::string& object, std::optional<rgbd::Frame> frame) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (busy_) throw std::logic_error("assessor: a job is under way");
    job_ = object;
    job_frame_ = std::move(frame);
    progress_ = 0.0;
    reading_ = busy_ = true;
  }
  wake_.notify_all();
}

void Worker::WaitUntilRead() {
  std::unique_lock<std::mutex> lock(mutex_);
  changed_.wait(lock, [this] { return !reading_; });
}

void Worker::WaitUntilDone() {
  std::unique_lock<std::mutex> lock(mutex_);
  changed_.wait(lock, [this] { return !busy_; });
}

std::optional<Assessment> Worker::Poll() {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::optional<Assessment> result;
  result.swap(result_);
  return result;
}

void Worker::Run() {
  // On Linux a niceness is a thread's own.
  setpriority(PRIO_PROCESS, static_cast<id_t>(syscall(SYS_gettid)), params_.niceness);
  while (true) {
    std::string object;
    std::optional<rgbd::Frame> frame;
    {
      std::unique_lock<std::mutex> lock(mutex_);
      wake_.wait(lock, [this] { return stop_ || job_; });
      if (stop_) return;
      object = std::move(*job_);
      frame = std::move(job_frame_);
      job_.reset();
      job_frame_.reset();
    }
    Assessment assessment;
    try {
      assessment = Assess(object, frame);
    } catch (const BrokenOff&) {
      return;
    } catch (const std::exception& error) {
      assessment.error = error.what();
    }
    assessment.object = object;
    const std::lock_guard<std::mutex> lock(mutex_);
    result_ = std::move(assessment);
    reading_ = busy_ = false;
    changed_.notify_all();
  }
}

Worker::Known& Worker::Read(const model::Store& store, const std::string& object) {
  auto model = store.Load(object);
  if (!model || model->views.empty()) throw std::runtime_error(params_.store + ": no views of '" + object + "'");
  Known& known = known_[object];
  const auto time_of = [](const model::ObjectModel& of, int id) {
    for (const model::View& view : of.views) {
      if (view.id == id) return view.utime;
    }
    return std::int64_t{-1};
  };
  for (auto trials = known.trials.begin(); trials != known.trials.end();) {
    // A view may have been merged with another; the same id at another time is an object learned anew.
    const std::int64_t utime = time_of(*model, trials->first);
    trials = utime >= 0 && utime == time_of(*known.model, trials->first) ? std::next(trials) : known.trials.erase(trials);
  }
  known.model = std::make_shared<const model::ObjectModel>(std::move(*model));
  return known;
}

const model::View* Worker::Next(const Known& known) {
  const model::View* unfinished = nullptr;
  for (const model::View& view : known.model->views) {
    const auto of_view = known.trials.find(view.id);
    if (of_view == known.trials.end()) return &view;
    if (of_view->second.parts < kParts && !unfinished) unfinished = &view;
  }
  return unfinished;
}

Assessment Worker::Assess(const std::string& object, const std::optional<rgbd::Frame>& frame) {
  if (frame) AddBackground(*frame);
  const model::Store store(params_.store, model::Store::Mode::kRead);
  Known& known = Read(store, object);
  AddLookAlikes(store, object);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    reading_ = false;
  }
  changed_.notify_all();
  if (const model::View* next = Next(known)) {
    std::vector<int> first_views(static_cast<std::size_t>(next - known.model->views.data()) + 1);
    std::iota(first_views.begin(), first_views.end(), 0);
    std::vector<assessment::Background> backgrounds = backgrounds_;
    for (const auto& [name, lookalike] : lookalikes_) {
      if (name != object) backgrounds.push_back(lookalike);
    }
    const auto progress = [this](int done, int of) {
      if (stop_) throw BrokenOff();
      progress_ = static_cast<double>(done) / of;
    };
    const auto begun = known.trials.find(next->id);
    const int part = begun == known.trials.end() ? 0 : begun->second.parts;
    const auto trials = assessment::RunTrials(known.model->OnlyViews(first_views), first_views.back(), &backgrounds,
                                              params_.recogniser, params_.trials, progress, {part, kParts});
    std::copy_n(backgrounds.begin(), backgrounds_.size(), backgrounds_.begin());  // With what was found out about them.
    ViewTrials& of_view = known.trials[next->id];                                 // Only now: trials that threw are no trials.
    of_view.trials.insert(of_view.trials.end(), trials.begin(), trials.end());
    ++of_view.parts;
  }

  Assessment result;
  result.utime = known.model->views.back().utime;
  result.views = known.model->viewpoints();
  result.assessed_views = static_cast<int>(known.trials.size());
  result.finished = Next(known) == nullptr;
  std::vector<assessment::Trial> all;
  for (const auto& [id, of_view] : known.trials) all.insert(all.end(), of_view.trials.begin(), of_view.trials.end());
  result.measures = assessment::FitMeasures(all, params_.recogniser, params_.trials.observed_fit);
  result.trials = static_cast<int>(all.size());
  return result;
}

void Worker::AddBackground(const rgbd::Frame& frame) {
  if (static_cast<int>(backgrounds_.size()) >= params_.max_backgrounds) return;
  const auto plane = segmentation::FitPlane(frame, params_.plane);
  if (!plane) return;  // Where objects cannot be masked, they would be taken for background.
  cv::Mat objects = cv::Mat::zeros(frame.color.size(), CV_8UC1);
  for (const auto& cluster : segmentation::FindClusters(frame, *plane, params_.clusters)) objects |= cluster.mask;
  backgrounds_.push_back(WithFeatures(assessment::MaskedBackground(frame.color, objects)));
}

void Worker::AddLookAlikes(const model::Store& store, const std::string& object) {
  if (backgrounds_.empty()) return;
  for (const model::Store::Summary& summary : store.List()) {
    if (static_cast<int>(lookalikes_.size()) >= params_.max_lookalikes) return;
    if (summary.name == object || summary.views == 0 || lookalikes_.count(summary.name)) continue;
    const auto other = store.Load(summary.name);
    const auto seed = static_cast<std::uint32_t>(lookalikes_.size());
    if (other) lookalikes_[summary.name] = WithFeatures(assessment::WithLookAlike(backgrounds_.front().color, *other, seed));
  }
}

assessment::Background Worker::WithFeatures(const cv::Mat& color) const {
  rgbd::Frame frame;
  frame.color = color;
  return {color, std::make_shared<const features::Features>(recognition::Recogniser(params_.recogniser).Extract(frame))};
}

}  // namespace vantage::assessor
