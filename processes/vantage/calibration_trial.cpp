#include "vantage/calibration_trial.h"

#include <algorithm>
#include <memory>
#include <mutex>
#include <numeric>
#include <opencv2/core/utility.hpp>
#include <random>

#include "assessment/background.h"
#include "geometry/view_sphere.h"
#include "model/store.h"
#include "vantage/held_out_frames.h"
#include "vantage/known_views.h"
#include "vantage/sequence.h"
#include "vantage/truth_judge.h"

namespace vantage::cli {
namespace {

constexpr int kMaxBackgrounds = 8;  // As the assessor keeps.
constexpr int kMinTrialsPerView = 8;
constexpr int kSimulatedFrames = 96;

// `count` of 0..of-1, ascending.
std::vector<int> Draw(int count, int of, std::mt19937* random) {
  std::vector<int> all(static_cast<std::size_t>(of));
  std::iota(all.begin(), all.end(), 0);
  for (int i = 0; i < count; ++i) {
    const auto other = static_cast<std::uint64_t>((*random)()) * static_cast<std::uint64_t>(of - i) >> 32;
    std::swap(all[static_cast<std::size_t>(i)], all[static_cast<std::size_t>(i) + other]);
  }
  all.resize(static_cast<std::size_t>(count));
  std::sort(all.begin(), all.end());
  return all;
}

// What every model of one run shares.
class Field {
 public:
  Field(const CalibrationOptions& options, const params::LibraryParams& params) : options_(options), params_(params) {
    if (options.world) {
      std::vector<int> ids(kSimulatedFrames);
      std::iota(ids.begin(), ids.end(), 0);
      SplitIds(ids);
      simulated_ = std::make_unique<SimulatedObject>(*options.world, kSimulatedFrames, judged_ids_,
                                                     options.turned_deg * M_PI / 180.0, options.seed);
      known_ = simulated_.get();
    } else {
      scene_ = std::make_unique<rgbd::BopScene>(options.folder);
      recorded_ = std::make_unique<RecordedObject>(*scene_, options.object_id);
      known_ = recorded_.get();
      SplitIds(known_->ids());
    }
    truth_.points_in_mesh = known_->Surface(learned_ids_);
    truth_.correct_m = params.trials.correct_m;
    // As the learner has it: the object's frame is in its middle.
    truth_.T_mesh_object.translation() = truth_.points_in_mesh.rowwise().mean();
  }

  const assessment::Truth& truth() const { return truth_; }
  assessment::Truth* mutable_truth() { return &truth_; }
  const rgbd::BopScene& scene() const { return *scene_; }
  int offered() const { return static_cast<int>(learned_ids_.size()); }

  model::ObjectModel Learn() const { return known_->Learn(learned_ids_, params_.recogniser.features, truth_.T_mesh_object); }

  // Frames that judge, then those without the object.
  std::vector<assessment::HeldOutFrame> HeldOut() const {
    std::vector<assessment::HeldOutFrame> frames;
    for (const int id : judged_ids_) frames.push_back(HoldOut(known_->Load(id), known_->TruePose(id), truth_));
    for (std::size_t i = 0; simulated_ && i < judged_ids_.size(); i += static_cast<std::size_t>(options_.absent_step)) {
      frames.push_back(HoldOut(simulated_->Without(judged_ids_[i]), std::nullopt, truth_));
    }
    for (const std::string& folder : options_.absent) {
      const rgbd::BopScene absent(folder);
      for (std::size_t i = 0; i < absent.ids().size(); i += static_cast<std::size_t>(options_.absent_step)) {
        frames.push_back(HoldOut(absent.Load(absent.ids()[i]), std::nullopt, truth_));
      }
    }
    FindFeatures(params_.recogniser, &frames);
    return frames;
  }

  // Throws std::runtime_error where a view was learned from a frame that judges.
  void CheckUnseen(const model::ObjectModel& object) const {
    for (const model::View& view : object.views) {
      if (!std::binary_search(judged_ids_.begin(), judged_ids_.end(), static_cast<int>(view.frame_id))) continue;
      throw std::runtime_error(options_.store + ": '" + object.name + "' was learned from frame " + std::to_string(view.frame_id) +
                               ", which judges; learn it with --frames even");
    }
  }

  // Frames to learn from with the object masked, as the assessor keeps them of its run.
  std::vector<assessment::Background> Backgrounds(std::mt19937* random) const {
    const int count = std::min(kMaxBackgrounds, static_cast<int>(learned_ids_.size()));
    std::vector<assessment::Background> images;
    for (const int i : Draw(count, static_cast<int>(learned_ids_.size()), random)) {
      const int id = learned_ids_[static_cast<std::size_t>(i)];
      images.push_back({assessment::MaskedBackground(known_->Load(id).color, known_->Mask(id)), nullptr});
    }
    return images;
  }

 private:
  // Those that teach from those that judge.
  void SplitIds(const std::vector<int>& ids) {
    int evens = 0;
    for (const int id : ids) {
      const bool even = id % 2 == 0;
      if (!options_.tune) (even ? learned_ids_ : judged_ids_).push_back(id);
      if (options_.tune && even) (evens++ % 2 == 1 ? judged_ids_ : learned_ids_).push_back(id);
    }
  }

  const CalibrationOptions& options_;
  const params::LibraryParams& params_;
  std::unique_ptr<rgbd::BopScene> scene_;  // Of a recording.
  std::unique_ptr<RecordedObject> recorded_;
  std::unique_ptr<SimulatedObject> simulated_;  // Else.
  const KnownFrames* known_ = nullptr;          // One of these.
  std::vector<int> learned_ids_, judged_ids_;
  assessment::Truth truth_;
};

// Degrees above the object's horizon of the lowest camera among the frames that count; 90 without any.
double LowestElevation(const std::vector<assessment::HeldOutFrame>& frames, const assessment::Truth& truth) {
  double lowest = 90.0;
  for (const assessment::HeldOutFrame& frame : frames) {
    if (!frame.counts) continue;
    lowest =
        std::min(lowest, geometry::Elevation(geometry::ViewDirection(*frame.T_camera_mesh * truth.T_mesh_object)) * 180.0 / M_PI);
  }
  return lowest;
}

// The trials of all views, `max_trials` at most, from where the frames that judge may have been taken.
assessment::TrialParams TrialsFor(assessment::TrialParams params, int views, int max_trials, double lowest_deg) {
  params.min_elevation_deg = std::clamp(lowest_deg, -90.0, 89.0);
  const int wanted = params.trials_per_view;
  params.trials_per_view = std::clamp(max_trials / views, std::min(wanted, kMinTrialsPerView), wanted);
  return params;
}

void Judge(const model::ObjectModel& object, const Field& field, const std::vector<assessment::HeldOutFrame>& frames,
           const params::LibraryParams& params, JudgedModel* judged) {
  judged->measures = object.measures;
  judged->hypotheses =
      assessment::Hypotheses(std::make_shared<const model::ObjectModel>(object), field.truth(), frames, params.recogniser);
  judged->looks = assessment::Looks(object, judged->hypotheses, frames, field.truth());
}

// Models drawn from all learned views, assessed by virtual views alone and judged.
class DrawnModels {
 public:
  DrawnModels(const CalibrationOptions& options, const params::LibraryParams& params, const Field& field,
              const std::vector<assessment::HeldOutFrame>& frames)
      : options_(options),
        params_(params),
        field_(field),
        frames_(frames),
        all_(field.Learn()),
        lowest_deg_(LowestElevation(frames, field.truth())) {
    alone_ = assessment::TryViewsAlone(all_, field.truth(), frames, params.recogniser);
    std::mt19937 random(options.seed);
    for (const int views : options.views) {
      if (views > static_cast<int>(all_.views.size())) continue;
      for (int draw = 0; draw < options.draws; ++draw) {
        chosen_.push_back(Draw(views, static_cast<int>(all_.views.size()), &random));
        judged_.emplace_back();
        judged_.back().views = views;
        judged_.back().draw = draw;
      }
    }
  }

  int learned_views() const { return static_cast<int>(all_.views.size()); }

  std::vector<JudgedModel> Run(const std::function<void(int done, int of)>& progress) {
    std::mutex mutex;
    int done = 0;
    const int count = static_cast<int>(judged_.size());
    cv::parallel_for_(
        cv::Range(0, count),
        [&](const cv::Range& range) {
          for (int i = range.end - 1; i >= range.start; --i) {
            RunOne(static_cast<std::size_t>(i));
            const std::lock_guard<std::mutex> lock(mutex);
            if (progress) progress(++done, count);
          }
        },
        count);
    return std::move(judged_);
  }

 private:
  void RunOne(std::size_t i) {
    JudgedModel& judged = judged_[i];
    model::ObjectModel object = all_.OnlyViews(chosen_[i]);
    assessment::TrialParams trials = TrialsFor(params_.trials, judged.views, options_.max_trials, lowest_deg_);
    trials.seed = options_.seed + static_cast<std::uint32_t>(i);
    std::mt19937 random(trials.seed);
    auto backgrounds = field_.Backgrounds(&random);
    judged.trials = assessment::RunTrials(object, 0, &backgrounds, params_.recogniser, trials);
    object.measures = assessment::FitMeasures(judged.trials, params_.recogniser, trials.observed_fit);
    for (const assessment::ViewTrial& trial : alone_) {
      if (std::binary_search(chosen_[i].begin(), chosen_[i].end(), trial.view)) judged.view_trials.push_back(trial);
    }
    Judge(object, field_, frames_, params_, &judged);
  }

  const CalibrationOptions& options_;
  const params::LibraryParams& params_;
  const Field& field_;
  const std::vector<assessment::HeldOutFrame>& frames_;
  model::ObjectModel all_;
  double lowest_deg_;
  std::vector<assessment::ViewTrial> alone_;
  std::vector<std::vector<int>> chosen_;  // View indices of every model.
  std::vector<JudgedModel> judged_;
};

JudgedModel JudgeStored(const CalibrationOptions& options, const params::LibraryParams& params, Field& field,
                        const std::vector<assessment::HeldOutFrame>& frames) {
  const model::ObjectModel object = OnlyObjectOf(options.store);
  if (object.measures.fingerprint != params.recogniser.Fingerprint()) {
    throw std::runtime_error(options.store + ": the measures of '" + object.name + "' are " +
                             (object.measures.fingerprint.empty() ? "not learned yet" : "of other recogniser settings") +
                             "; run vantage assess with this --config");
  }
  field.CheckUnseen(object);
  field.mutable_truth()->T_mesh_object = MeshFromObject(field.scene(), options.object_id, object);
  JudgedModel judged;
  judged.views = static_cast<int>(object.views.size());
  judged.view_trials = assessment::TryViewsAlone(object, field.truth(), frames, params.recogniser);
  Judge(object, field, frames, params, &judged);
  return judged;
}

}  // namespace

double JudgedModel::DetectionRate() const {
  double detected = 0.0;
  for (const measures::JointSample& look : looks) detected += look.detected;
  return looks.empty() ? 0.0 : detected / static_cast<double>(looks.size());
}

double JudgedModel::Completeness(measures::CompletenessRule rule) const {
  double sum = 0.0;
  for (const measures::JointSample& look : looks) sum += look.predicted.Value(rule, measures.predicted.common_cause());
  return looks.empty() ? 0.0 : sum / static_cast<double>(looks.size());
}

CalibrationTrial TryCalibration(const CalibrationOptions& options, const params::LibraryParams& params,
                                const std::function<void(int done, int of)>& progress) {
  Field field(options, params);
  CalibrationTrial trial;
  trial.frames = field.HeldOut();
  trial.offered = field.offered();
  if (!options.store.empty()) {
    trial.models.push_back(JudgeStored(options, params, field, trial.frames));
    trial.taught = trial.models.front().views;
  } else {
    DrawnModels models(options, params, field, trial.frames);
    trial.taught = models.learned_views();
    trial.models = models.Run(progress);
  }
  return trial;
}

}  // namespace vantage::cli
