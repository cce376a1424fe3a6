#include "assessment/held_out.h"

#include <cmath>
#include <opencv2/core/utility.hpp>
#include <stdexcept>

namespace vantage::assessment {
namespace {

recognition::RecogniserParams AllHypotheses(recognition::RecogniserParams params) {
  params.use_query_depth = false;
  params.min_probability = 0.0;
  return params;
}

measures::Viewpoint ViewpointOf(const geometry::Rigid& T_camera_object) {
  return {geometry::ViewDirection(T_camera_object), T_camera_object.translation().norm()};
}

// body(i) for i < count, on all cores.
template <typename Body>
void InParallel(std::size_t count, const Body& body) {
  cv::parallel_for_(cv::Range(0, static_cast<int>(count)), [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i) body(static_cast<std::size_t>(i));
  });
}

}  // namespace

bool Truth::IsRight(const geometry::Rigid& T_camera_object, const HeldOutFrame& frame) const {
  if (!frame.T_camera_mesh) return false;
  return model::MeanPointDistance(points_in_mesh, T_camera_object * T_mesh_object.inverse(), *frame.T_camera_mesh) < correct_m;
}

Eigen::Vector3d Truth::ErrorByAxis(const geometry::Rigid& T_camera_object, const HeldOutFrame& frame) const {
  if (!frame.T_camera_mesh) throw std::logic_error("Truth: the object is not in this frame");
  const geometry::Rigid T_camera_mesh = T_camera_object * T_mesh_object.inverse();
  const Eigen::Matrix3Xd off = (T_camera_mesh * points_in_mesh) - (*frame.T_camera_mesh * points_in_mesh);
  return off.cwiseAbs().rowwise().mean();
}

std::vector<HeldOutHypothesis> Hypotheses(const std::shared_ptr<const model::ObjectModel>& object, const Truth& truth,
                                          const std::vector<HeldOutFrame>& frames,
                                          const recognition::RecogniserParams& recogniser_params) {
  recognition::Recogniser recogniser(AllHypotheses(recogniser_params));
  recogniser.Set(object);
  std::vector<std::vector<HeldOutHypothesis>> by_frame(frames.size());
  InParallel(frames.size(), [&](std::size_t i) {
    for (const recognition::Detection& detection : recogniser.Recognise(frames[i].frame, frames[i].features)) {
      by_frame[i].push_back({static_cast<int>(i), detection.confidence.value, truth.IsRight(detection.T_camera_object, frames[i])});
    }
  });
  std::vector<HeldOutHypothesis> all;
  for (const auto& hypotheses : by_frame) all.insert(all.end(), hypotheses.begin(), hypotheses.end());
  return all;
}

std::vector<ViewTrial> TryViewsAlone(const model::ObjectModel& object, const Truth& truth, const std::vector<HeldOutFrame>& frames,
                                     const recognition::RecogniserParams& recogniser_params) {
  std::vector<ViewTrial> trials;
  std::vector<measures::Viewpoint> seen_from(frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (frames[i].counts) seen_from[i] = ViewpointOf(*frames[i].T_camera_mesh * truth.T_mesh_object);
  }
  for (std::size_t view = 0; view < object.views.size(); ++view) {
    recognition::Recogniser recogniser(AllHypotheses(recogniser_params));
    recogniser.Set(std::make_shared<model::ObjectModel>(object.OnlyView(static_cast<int>(view))));
    const measures::Viewpoint learned = object.views[view].viewpoint();
    const std::size_t first = trials.size();
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const double rotation_rad = geometry::AngleBetween(learned.direction, seen_from[i].direction);
      if (!frames[i].counts || rotation_rad >= M_PI_2) continue;
      ViewTrial trial;
      trial.view = static_cast<int>(view);
      trial.frame = static_cast<int>(i);
      trial.rotation_rad = rotation_rad;
      trial.log2_scale = std::log2(learned.distance_m / seen_from[i].distance_m);
      trials.push_back(trial);
    }
    InParallel(trials.size() - first, [&](std::size_t k) {
      ViewTrial& trial = trials[first + k];
      const HeldOutFrame& frame = frames[static_cast<std::size_t>(trial.frame)];
      const auto detections = recogniser.Recognise(frame.frame, frame.features);
      if (detections.empty()) return;
      const geometry::Rigid& T_camera_object = detections.front().T_camera_object;
      trial.hypothesis = true;
      trial.right = truth.IsRight(T_camera_object, frame);
      trial.error_m =
          model::MeanPointDistance(truth.points_in_mesh, T_camera_object * truth.T_mesh_object.inverse(), *frame.T_camera_mesh);
      trial.error_by_axis_m = truth.ErrorByAxis(T_camera_object, frame);
      trial.confidence = detections.front().confidence.value;
    });
  }
  return trials;
}

bool IsDetected(const ViewTrial& trial, const measures::ObservedSuccess& observed) {
  return trial.right && observed.Probability(trial.confidence) >= 0.5;
}

measures::ObservedSuccess FitObserved(const std::vector<HeldOutHypothesis>& hypotheses) {
  std::vector<measures::ConfidenceSample> samples;
  for (const HeldOutHypothesis& hypothesis : hypotheses) samples.push_back({hypothesis.confidence, hypothesis.right});
  return measures::ObservedSuccess::Fit(samples, measures::Source::kOwn);
}

measures::PredictedSuccess FitPredicted(const std::vector<ViewTrial>& trials, const measures::ObservedSuccess& observed) {
  std::vector<measures::PredictionSample> samples;
  for (const ViewTrial& trial : trials) samples.push_back({trial.rotation_rad, trial.log2_scale, IsDetected(trial, observed)});
  return measures::PredictedSuccess::Fit(samples, measures::Source::kOwn);
}

std::vector<measures::JointSample> Looks(const model::ObjectModel& object, const std::vector<HeldOutHypothesis>& hypotheses,
                                         const std::vector<HeldOutFrame>& frames, const Truth& truth) {
  std::vector<bool> detected(frames.size(), false);
  for (std::size_t i = 0; i < hypotheses.size(); ++i) {
    const bool most_likely = i == 0 || hypotheses[i - 1].frame != hypotheses[i].frame;
    const bool believed = object.measures.observed.Probability(hypotheses[i].confidence) >= 0.5;
    if (most_likely) detected[static_cast<std::size_t>(hypotheses[i].frame)] = hypotheses[i].right && believed;
  }
  std::vector<measures::JointSample> looks;
  const auto viewpoints = object.viewpoints();
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (!frames[i].counts) continue;
    const measures::Viewpoint seen_from = ViewpointOf(*frames[i].T_camera_mesh * truth.T_mesh_object);
    looks.push_back({measures::Joint(viewpoints, seen_from, object.measures.predicted), detected[i]});
  }
  return looks;
}

}  // namespace vantage::assessment
