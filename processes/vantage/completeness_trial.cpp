#include "vantage/completeness_trial.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <random>

#include "measures/calibration.h"
#include "vantage/held_out_frames.h"
#include "vantage/known_views.h"

namespace vantage::cli {
namespace {

using Indices = std::vector<int>;

Indices Shuffled(int count, std::mt19937* random) {
  Indices all(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) all[static_cast<std::size_t>(i)] = i;
  for (int i = count - 1; i > 0; --i) {
    const auto other = static_cast<std::uint64_t>((*random)()) * static_cast<std::uint64_t>(i + 1) >> 32;
    std::swap(all[static_cast<std::size_t>(i)], all[static_cast<std::size_t>(other)]);
  }
  return all;
}

// One recording; every frame was learned from and is held out: splits say which it is.
class Photographs {
 public:
  Photographs(const CompletenessOptions& options, const params::LibraryParams& params)
      : recogniser_(params.recogniser), scene_(options.folder), known_(scene_, options.object_id) {
    for (const int id : rgbd::SelectFrames(known_.ids(), options.frames)) ids_.push_back(id);
    truth_.points_in_mesh = known_.Surface(ids_);
    truth_.correct_m = params.trials.correct_m;
    truth_.T_mesh_object.translation() = truth_.points_in_mesh.rowwise().mean();
    all_ = known_.Learn(ids_, params.recogniser.features, truth_.T_mesh_object);
    for (const int id : ids_) frames_.push_back(HoldOut(known_.Load(id), known_.TruePose(id), truth_));
    FindFeatures(params.recogniser, &frames_);
    alone_ = assessment::TryViewsAlone(all_, truth_, frames_, params.recogniser);
    for (const model::View& view : all_.views) {
      const auto frame = std::lower_bound(ids_.begin(), ids_.end(), static_cast<int>(view.frame_id));
      frame_of_view_.push_back(static_cast<int>(frame - ids_.begin()));
    }
  }

  int frames() const { return static_cast<int>(frames_.size()); }

  // What a model of the first views learned from `learn` does in the frames that judge; its measures are of the frames `fit`. None
  // where there are fewer views.
  std::vector<measures::JointSample> Judge(const Indices& learn, const Indices& fit, const Indices& judge, int views,
                                           double* common_cause) const {
    Indices offered;
    for (std::size_t view = 0; view < frame_of_view_.size(); ++view) {
      const auto place = std::find(learn.begin(), learn.end(), frame_of_view_[view]);
      if (place != learn.end()) offered.push_back(static_cast<int>(view));
    }
    if (static_cast<int>(offered.size()) < views) return {};
    // In the order of the split, which is random.
    std::sort(offered.begin(), offered.end(), [&](int a, int b) { return PlaceOf(a, learn) < PlaceOf(b, learn); });
    auto object = std::make_shared<model::ObjectModel>(all_.OnlyViews(Indices(offered.begin(), offered.begin() + views)));
    const std::vector<assessment::HeldOutFrame> fit_frames = Frames(fit), judge_frames = Frames(judge);
    const auto hypotheses = assessment::Hypotheses(object, truth_, fit_frames, recogniser_);
    object->measures.observed = assessment::FitObserved(hypotheses);
    object->measures.predicted = assessment::FitPredicted(Alone(offered, fit), object->measures.observed);
    *common_cause = measures::FitCommonCause(assessment::Looks(*object, hypotheses, fit_frames, truth_));
    object->measures.predicted.set_common_cause(*common_cause);
    return assessment::Looks(*object, assessment::Hypotheses(object, truth_, judge_frames, recogniser_), judge_frames, truth_);
  }

 private:
  std::ptrdiff_t PlaceOf(int view, const Indices& learn) const {
    return std::find(learn.begin(), learn.end(), frame_of_view_[static_cast<std::size_t>(view)]) - learn.begin();
  }

  std::vector<assessment::HeldOutFrame> Frames(const Indices& indices) const {
    std::vector<assessment::HeldOutFrame> frames;
    for (const int i : indices) frames.push_back(frames_[static_cast<std::size_t>(i)]);
    return frames;
  }

  std::vector<assessment::ViewTrial> Alone(const Indices& views, const Indices& frames) const {
    std::vector<assessment::ViewTrial> trials;
    for (const assessment::ViewTrial& trial : alone_) {
      if (std::find(views.begin(), views.end(), trial.view) == views.end()) continue;
      if (std::find(frames.begin(), frames.end(), trial.frame) != frames.end()) trials.push_back(trial);
    }
    return trials;
  }

  recognition::RecogniserParams recogniser_;
  rgbd::BopScene scene_;
  RecordedObject known_;
  assessment::Truth truth_;
  std::vector<int> ids_;
  model::ObjectModel all_;
  std::vector<assessment::HeldOutFrame> frames_;
  std::vector<assessment::ViewTrial> alone_;
  Indices frame_of_view_;
};

}  // namespace

double CompletenessFigures::DetectionRate() const {
  double detected = 0.0, of = 0.0;
  for (const auto& split : looks) {
    for (const measures::JointSample& look : split) detected += look.detected, of += 1.0;
  }
  return of > 0.0 ? detected / of : 0.0;
}

double CompletenessFigures::Predicted(measures::CompletenessRule rule) const {
  double sum = 0.0, of = 0.0;
  for (std::size_t i = 0; i < looks.size(); ++i) {
    for (const measures::JointSample& look : looks[i]) sum += look.predicted.Value(rule, common_cause[i]), of += 1.0;
  }
  return of > 0.0 ? sum / of : 0.0;
}

double CompletenessFigures::DifferenceSd(measures::CompletenessRule rule) const {
  double sum = 0.0, squares = 0.0;
  for (std::size_t i = 0; i < looks.size(); ++i) {
    double difference = 0.0;
    for (const measures::JointSample& look : looks[i]) difference += look.predicted.Value(rule, common_cause[i]) - look.detected;
    difference /= static_cast<double>(std::max<std::size_t>(1, looks[i].size()));
    sum += difference;
    squares += difference * difference;
  }
  const double of = static_cast<double>(std::max<std::size_t>(1, looks.size()));
  return std::sqrt(std::max(0.0, squares / of - sum * sum / (of * of)));
}

double CompletenessFigures::BrierScore(measures::CompletenessRule rule) const {
  std::vector<measures::Forecast> forecasts;
  for (std::size_t i = 0; i < looks.size(); ++i) {
    for (const auto& look : looks[i]) forecasts.push_back({look.predicted.Value(rule, common_cause[i]), look.detected});
  }
  return measures::BrierScore(forecasts);
}

std::vector<CompletenessFigures> TryCompleteness(const CompletenessOptions& options, const params::LibraryParams& params,
                                                 const std::function<void(int done, int of)>& progress) {
  const Photographs photographs(options, params);
  std::vector<CompletenessFigures> figures(options.views.size());
  for (std::size_t k = 0; k < figures.size(); ++k) figures[k].views = options.views[k];
  std::mt19937 random(options.seed);
  for (int split = 0; split < options.splits; ++split) {
    const Indices all = Shuffled(photographs.frames(), &random);
    const auto third = static_cast<std::ptrdiff_t>(all.size() / 3);
    const Indices learn(all.begin(), all.begin() + third), fit(all.begin() + third, all.begin() + 2 * third),
        judge(all.begin() + 2 * third, all.end());
    for (CompletenessFigures& of : figures) {
      double common_cause = 0.0;
      auto looks = photographs.Judge(learn, fit, judge, of.views, &common_cause);
      if (looks.empty()) continue;
      of.looks.push_back(std::move(looks));
      of.common_cause.push_back(common_cause);
    }
    if (progress) progress(split + 1, options.splits);
  }
  return figures;
}

double PooledCommonCause(const std::vector<CompletenessFigures>& figures) {
  std::vector<measures::JointSample> looks;
  for (const CompletenessFigures& of : figures) {
    if (of.views < 2) continue;
    for (const auto& split : of.looks) looks.insert(looks.end(), split.begin(), split.end());
  }
  return measures::FitCommonCause(looks);
}

Json ToJson(const std::vector<CompletenessFigures>& figures) {
  Json json = Json::array();
  for (const CompletenessFigures& of : figures) {
    Json entry = {{"views", of.views}, {"models", of.looks.size()}, {"detection_rate", of.DetectionRate()}};
    double common_cause = 0.0;
    for (const double share : of.common_cause) common_cause += share / static_cast<double>(of.common_cause.size());
    entry["common_cause_fitted"] = common_cause;
    for (const auto rule : measures::kCompletenessRules) {
      entry[measures::ToString(rule)] = {{"predicted", of.Predicted(rule)},
                                         {"difference", of.Predicted(rule) - of.DetectionRate()},
                                         {"difference_sd", of.DifferenceSd(rule)},
                                         {"brier_score", of.BrierScore(rule)}};
    }
    json.push_back(std::move(entry));
  }
  return json;
}

std::string TableOf(const std::vector<CompletenessFigures>& figures) {
  char line[300];
  std::string text =
      "                 predicted (SD of predicted - detected over models), Brier score of single looks\nviews  detected";
  for (const auto rule : measures::kCompletenessRules) {
    std::snprintf(line, sizeof line, "  %18s", measures::ToString(rule).c_str());
    text += line;
  }
  text += "  common cause\n";
  for (const Json& of : ToJson(figures)) {
    std::snprintf(line, sizeof line, "%5d  %8.3f", of["views"].get<int>(), of["detection_rate"].get<double>());
    text += line;
    for (const auto rule : measures::kCompletenessRules) {
      const Json& by_rule = of[measures::ToString(rule)];
      std::snprintf(line, sizeof line, "  %.3f (%.3f) %.3f", by_rule["predicted"].get<double>(),
                    by_rule["difference_sd"].get<double>(), by_rule["brier_score"].get<double>());
      text += line;
    }
    std::snprintf(line, sizeof line, "  %.2f\n", of["common_cause_fitted"].get<double>());
    text += line;
  }
  return text;
}

}  // namespace vantage::cli
