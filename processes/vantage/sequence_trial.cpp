#include "vantage/sequence_trial.h"

#include <algorithm>

#include "vantage/learner_trial.h"
#include "vantage/pose_witness.h"
#include "vantage/sequence.h"

namespace vantage::cli {
namespace {

class SequenceRun {
 public:
  SequenceRun(const SequenceTrialOptions& options, const learning::LearnerParams& params)
      : options_(options), scene_(options.folder), name_(NameOfFolder(options.folder)), trial_(params, name_) {
    if (options.object_id > 0) label_ = LabelOfObject(scene_, options.object_id);
  }

  void Learn() {
    const std::vector<int> ids = FramesOf(scene_, options_.frames);
    for (int pass = 0; pass < options_.passes; ++pass) {
      for (const int id : ids) Step(id, pass);
    }
    trial_.Finish();
    if (!trial_.learner().object()) {
      throw std::runtime_error(options_.folder + ": no object was found in " + std::to_string(ids.size()) + " frames (" +
                               (trial_.steps().empty() ? "it is in none of them" : trial_.steps().back().result.note) + ")");
    }
  }

  // The recogniser on frames that nothing is learned from.
  Json Find(const recognition::RecogniserParams& params) const {
    recognition::Recogniser recogniser(params);
    recogniser.Set(trial_.learner().object());
    std::vector<PoseError> errors;
    int frames = 0, right = 0, wrong = 0;
    for (const int id : FramesOf(scene_, options_.find)) {
      rgbd::Frame frame = scene_.Load(id);
      const FrameTruth truth = TruthIn(frame);
      frame.T_world_camera.reset();
      if (!params.use_query_depth) frame.depth = cv::Mat();
      frames += truth.usable;
      const auto detections = recogniser.Recognise(frame, recogniser.Extract(frame));
      if (detections.empty() || detections.front().probability < 0.5) continue;
      const auto error = trial_.ErrorOf(detections.front().T_camera_object, truth);
      const bool is_wrong = !error || error->wrong();
      wrong += is_wrong;
      right += !is_wrong;
      if (error) errors.push_back(*error);
    }
    return {{"frames", frames}, {"right", right}, {"wrong", wrong}, {"error", ErrorFigures(errors)}};
  }

  // Of the frames tracked in the first pass whose camera pose was recorded.
  Json Witness(const learning::LearnerParams& params) const {
    std::vector<WitnessedFrame> frames;
    for (const TrialStep& step : trial_.steps()) {
      if (!step.tracked || step.truth.circle > 0) continue;
      rgbd::Frame frame = scene_.Load(static_cast<int>(step.frame_id));
      if (!frame.T_world_camera || frame.depth.empty()) continue;
      const geometry::Rigid T_camera_world = frame.T_world_camera->inverse();
      frames.push_back({std::move(frame), T_camera_world, *step.result.T_camera_object});
    }
    return WitnessFigures(frames, params);
  }

  const LearnerTrial& trial() const { return trial_; }
  const std::string& name() const { return name_; }

 private:
  // Without an object's truth the world takes the mesh's place: the object does not move in it.
  FrameTruth TruthIn(const rgbd::Frame& frame) const {
    FrameTruth truth;
    const std::optional<int> id = options_.object_id > 0 ? std::optional(options_.object_id) : std::nullopt;
    const KnownPose known = KnownPoseOf(scene_, frame, id);
    if (id) {
      truth.T_camera_mesh = known.T_camera_mesh;
    } else if (known.T_world_camera) {
      truth.T_camera_mesh = known.T_world_camera->inverse();
    } else {
      throw std::runtime_error(options_.folder + ": frame " + std::to_string(frame.id) +
                               " has no known camera pose to judge by; name an object of scene_gt.json with --object-id");
    }
    truth.usable = truth.T_camera_mesh.has_value();
    return truth;
  }

  void Step(int id, int pass) {
    rgbd::Frame frame = scene_.Load(id);
    FrameTruth truth = TruthIn(frame);
    truth.circle = pass;
    truth.time_s = static_cast<double>(frames_++) / 30.0;
    learning::Target target;
    if (!trial_.learner().object() && options_.object_id > 0) {
      target.pixel = PixelOfObject(scene_, id, options_.object_id, label_);
      if (!target.pixel) return;  // It is not there yet.
    }
    frame.T_world_camera.reset();  // It judges; it must not help.
    trial_.Step(frame, truth, target);
  }

  SequenceTrialOptions options_;
  rgbd::BopScene scene_;
  std::string name_;
  std::optional<int> label_;
  LearnerTrial trial_;
  int frames_ = 0;
};

}  // namespace

Json TrySequence(const SequenceTrialOptions& options, learning::LearnerParams params, const std::string& save) {
  if (options.no_query_depth) params.recogniser.use_query_depth = false;
  SequenceRun run(options, params);
  run.Learn();
  Json result;
  result["object"] = run.name();
  result["fault"] = "none";
  result["passes"] = options.passes;
  result["query_depth"] = params.recogniser.use_query_depth;
  result.update(FiguresOf(run.trial()));
  if (!options.find.empty()) result["found"] = run.Find(params.recogniser);
  if (options.witness) result["witness"] = run.Witness(params);
  if (!save.empty()) SaveTrial(run.trial(), run.name(), save);
  return result;
}

}  // namespace vantage::cli
