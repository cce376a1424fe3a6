#include "assessment/held_out.h"

#include <cmath>
#include <opencv2/core/utility.hpp>

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
      const double log2_scale = std::log2(learned.distance_m / seen_from[i].distance_m);
      trials.push_back({static_cast<int>(view), static_cast<int>(i), rotation_rad, log2_scale, false, 0.0});
    }
    InParallel(trials.size() - first, [&](std::size_t k) {
      ViewTrial& trial = trials[first + k];
      const HeldOutFrame& frame = frames[static_cast<std::size_t>(trial.frame)];
      const auto detections = recogniser.Recognise(frame.frame, frame.features);
      if (detections.empty()) return;
      trial.right = truth.IsRight(detections.front().T_camera_object, frame);
      trial.confidence = detections.front().confidence.value;
    });
  }
  return trials;
}

double DetectionRate(const std::vector<HeldOutHypothesis>& hypotheses, const std::vector<HeldOutFrame>& frames,
                     const measures::ObservedSuccess& observed) {
  int of = 0, detected = 0;
  for (const HeldOutFrame& frame : frames) of += frame.counts;
  for (std::size_t i = 0; i < hypotheses.size(); ++i) {
    const HeldOutHypothesis& hypothesis = hypotheses[i];
    const bool most_likely = i == 0 || hypotheses[i - 1].frame != hypothesis.frame;
    if (!most_likely || !frames[static_cast<std::size_t>(hypothesis.frame)].counts) continue;
    detected += hypothesis.right && observed.Probability(hypothesis.confidence) >= 0.5;
  }
  return of > 0 ? detected / static_cast<double>(of) : 0.0;
}

std::vector<measures::WeightedViewpoint> ViewpointsOf(const std::vector<HeldOutFrame>& frames, const Truth& truth) {
  std::vector<measures::WeightedViewpoint> viewpoints;
  for (const HeldOutFrame& frame : frames) {
    if (frame.counts) viewpoints.push_back({ViewpointOf(*frame.T_camera_mesh * truth.T_mesh_object), 1.0});
  }
  return viewpoints;
}

}  // namespace vantage::assessment
