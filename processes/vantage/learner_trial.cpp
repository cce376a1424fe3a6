#include "vantage/learner_trial.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <fstream>

namespace vantage::cli {
namespace {

double ThreadTime_ms() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

double ResidentMemory_mb() {
  std::ifstream file("/proc/self/statm");
  double total = 0.0, resident = 0.0;
  file >> total >> resident;
  return resident * static_cast<double>(::sysconf(_SC_PAGESIZE)) / 1048576.0;
}

bool IsTracked(const learning::LearnerResult& result) {
  return result.state == learning::State::kTracking && result.T_camera_object.has_value();
}

}  // namespace

LearnerTrial::LearnerTrial(const learning::LearnerParams& params, const std::string& name)
    : params_(params), name_(name), learner_(params, name) {}

const TrialStep& LearnerTrial::Step(const rgbd::Frame& frame, const FrameTruth& truth, const learning::Target& target,
                                    const std::optional<geometry::Rigid>& known_pose) {
  TrialStep step;
  step.frame_id = frame.id;
  step.truth = truth;
  truth_[frame.id] = truth;
  const auto start = std::chrono::steady_clock::now();
  const double cpu_start_ms = ThreadTime_ms();
  step.result = learner_.Process(frame, target, known_pose);
  step.cpu_ms = ThreadTime_ms() - cpu_start_ms;
  step.ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  step.tracked = IsTracked(step.result);
  if (step.tracked) {
    if (!T_mesh_object_ && truth.T_camera_mesh) T_mesh_object_ = truth.T_camera_mesh->inverse() * *step.result.T_camera_object;
    step.error = ErrorOf(*step.result.T_camera_object, truth);
    step.wrong = !step.error || step.error->wrong();
  }
  if (const auto object = learner_.object()) {
    step.views = static_cast<int>(object->views.size());
    step.points = static_cast<int>(object->points.size());
    for (const ViewError& view : ViewErrors()) step.wrong_views += view.wrong();
  }
  step.memory_mb = ResidentMemory_mb();
  steps_.push_back(std::move(step));
  return steps_.back();
}

std::optional<PoseError> LearnerTrial::ErrorOf(const geometry::Rigid& T_camera_object, const FrameTruth& truth) const {
  if (!truth.T_camera_mesh || !T_mesh_object_) return std::nullopt;
  const geometry::PoseDifference difference = geometry::Difference(T_camera_object, *truth.T_camera_mesh * *T_mesh_object_);
  return PoseError{1e3 * difference.translation_m, difference.rotation_rad * 180.0 / M_PI};
}

std::vector<ViewError> LearnerTrial::ViewErrors() const {
  std::vector<ViewError> errors;
  const auto object = learner_.object();
  if (!object) return errors;
  for (const model::View& view : object->views) {
    const auto truth = truth_.find(view.frame_id);
    errors.push_back({view.id, view.frame_id, truth == truth_.end() ? std::nullopt : ErrorOf(view.T_camera_object, truth->second)});
  }
  return errors;
}

std::optional<PoseError> LearnerTrial::Replaced(const rgbd::Frame& frame, const FrameTruth& truth) const {
  if (!learner_.object()) return std::nullopt;
  constexpr int kLooks = 4;  // It takes some to be sure.
  learning::Learner again(params_, name_, learner_.object());
  for (int look = 0; look < kLooks; ++look) {
    const learning::LearnerResult result = again.Process(frame);
    if (IsTracked(result)) return ErrorOf(*result.T_camera_object, truth);
  }
  return std::nullopt;
}

}  // namespace vantage::cli
