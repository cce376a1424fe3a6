// vantage assess: learns an object's measures from virtual views of its stored model, and how complete the model is.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <sstream>

#include "assessment/assessor.h"
#include "geometry/view_sphere.h"
#include "model/store.h"
#include "vantage/held_out_frames.h"
#include "vantage/known_views.h"
#include "vantage/object_trials.h"
#include "vantage/report.h"
#include "vantage/sequence.h"
#include "vantage/truth_judge.h"
#include "vantage/verb.h"

namespace vantage::cli {
namespace {

constexpr int kReportImages = 1000;  // An object.
constexpr int kFullImages = 10000;   // An object; the paper's scale.

struct AssessOptions {
  CommonOptions common;
  std::string store;
  std::string object;          // Empty = every one.
  std::string backgrounds;     // Folder of images; empty = what is around the objects in their own views.
  int images = 0;              // Virtual images an object, kept on disk; 0 = as many as the parameters say, not kept.
  std::string report;          // Folder: only report on the objects...
  std::string sequence;        // ...with photographs of this recording...
  int object_id = 0;           // ...that show this object of its truth...
  std::string truth_object;    // ...which is this one of the store; empty: its first...
  std::string frames = "odd";  // ...and in these frames, from which nothing was learned.
  std::string predict;         // Only say how likely this object would be detected...
  std::vector<double> from;    // ...from this place of the camera in the object's frame, metres.
};

Json ToJson(const measures::Gaussian& gaussian) {
  return {{"mean", gaussian.mean}, {"sigma", gaussian.sigma}, {"count", gaussian.count}};
}

Json ToJson(const model::ObjectModel& object, const measures::Measures& fitted, const std::vector<assessment::Trial>& trials,
            double completeness) {
  Json observed;
  observed["source"] = measures::ToString(fitted.observed.source());
  observed["positive"] = ToJson(fitted.observed.positive());
  observed["negative"] = ToJson(fitted.observed.negative());
  Json predicted;
  predicted["source"] = measures::ToString(fitted.predicted.source());
  predicted["trials"] = fitted.predicted.trials();
  predicted["halfway_rotation_deg"] = fitted.predicted.HalfwayRotation() * 180.0 / M_PI;
  predicted["probability_per_5_deg"] = Json::array();
  for (int cell = 0; cell < measures::PredictedSuccess::kRotationCells; ++cell) {
    const double rotation_rad = (cell + 0.5) * measures::PredictedSuccess::kRotationStepRad;
    predicted["probability_per_5_deg"].push_back(fitted.predicted.Probability(rotation_rad));
  }
  Json entry;
  entry["object"] = object.name;
  entry["views"] = object.views.size();
  entry["completeness"] = completeness;
  entry["trials"] = trials.size();
  entry["hypotheses"] =
      std::count_if(trials.begin(), trials.end(), [](const assessment::Trial& trial) { return trial.hypothesis(); });
  entry["correct"] = std::count_if(trials.begin(), trials.end(), [](const assessment::Trial& trial) { return trial.correct(); });
  entry["observed"] = std::move(observed);
  entry["predicted"] = std::move(predicted);
  return entry;
}

// How likely the object would be detected from a place, by its stored measures.
void RunPredict(const AssessOptions& options) {
  CheckOutput(options.common);
  const params::LibraryParams params = LoadParams(options.common);
  const model::Store store(options.store, model::Store::Mode::kRead);
  const std::optional<model::ObjectModel> object = store.Load(options.predict);
  if (!object) throw std::runtime_error(options.store + ": no object '" + options.predict + "'; see vantage models list");
  if (object->views.empty()) throw std::runtime_error(options.store + ": object '" + options.predict + "' has no views");
  const std::string mismatch = recognition::MeasuresMismatch(*object, params.recogniser);
  if (!mismatch.empty()) throw std::runtime_error(options.store + ": " + mismatch);
  const Eigen::Vector3d place(options.from[0], options.from[1], options.from[2]);
  if (!(place.norm() > 0.01)) throw std::runtime_error("--from: the camera would be inside the object");
  const measures::Viewpoint query{place.normalized(), place.norm()};
  const measures::PredictedSuccess& predicted = object->measures.predicted;
  const double probability = measures::DetectionProbability(object->viewpoints(), query, predicted, params.planner.rule);
  // The view that says most for it.
  int best = 0;
  double most = -1.0, rotation_deg = 0.0;
  for (const model::View& view : object->views) {
    const double p = measures::DetectionProbability({view.viewpoint()}, query, predicted);
    if (p <= most) continue;
    most = p;
    best = view.id;
    rotation_deg = geometry::AngleBetween(view.viewpoint().direction, query.direction) * 180.0 / M_PI;
  }
  Json result = {{"object", object->name},
                 {"from", options.from},
                 {"probability", probability},
                 {"source", measures::ToString(predicted.source())},
                 {"view", best},
                 {"rotation_deg", rotation_deg}};
  std::ostringstream summary;
  summary.precision(3);
  summary << object->name << " would be detected with probability " << probability << " from there (" << rotation_deg
          << " degrees from view " << best << "; measures: " << measures::ToString(predicted.source()) << ")\n";
  WriteResult(options.common, result, summary.str());
}

std::vector<std::string> NamesToAssess(const AssessOptions& options, const model::Store& store) {
  std::vector<std::string> names;
  for (const model::Store::Summary& summary : store.List()) {
    if (options.object.empty() || options.object == summary.name) names.push_back(summary.name);
  }
  if (!names.empty()) return names;
  throw std::runtime_error(options.store + (options.object.empty()
                                                ? ": holds no objects; learn one with vantage learn"
                                                : ": no object '" + options.object + "'; see vantage models list"));
}

void RunAssess(const AssessOptions& options) {
  CheckOutput(options.common);
  const params::LibraryParams params = LoadParams(options.common);
  if (!std::filesystem::exists(options.store)) model::Store(options.store, model::Store::Mode::kRead);  // Says that it is missing.
  model::Store store(options.store, model::Store::Mode::kWrite);
  const std::vector<std::string> names = NamesToAssess(options, store);

  Json result;
  result["store"] = options.store;
  result["objects"] = Json::array();
  std::ostringstream summary;
  summary.precision(3);
  for (const std::string& name : names) {
    const std::optional<model::ObjectModel> object = store.Load(name);
    if (!object) throw std::runtime_error(options.store + ": object '" + name + "' was removed meanwhile");
    if (object->views.empty()) throw std::runtime_error(options.store + ": object '" + name + "' has no views; learn it again");
    auto backgrounds = BackgroundsFor(*object, options.backgrounds, store);
    const std::vector<assessment::Trial> trials =
        options.images > 0
            ? KeptObjectTrials(options.store + ".trials", *object, options.backgrounds, &backgrounds, options.images, params)
            : RunObjectTrials(*object, &backgrounds, params);
    const measures::Measures fitted = assessment::FitMeasures(trials, params.recogniser, params.trials.observed_fit);
    const std::vector<measures::WeightedViewpoint> directions =
        assessment::UniformViewpoints(params.candidates.min_elevation_rad, params.candidates.max_elevation_rad,
                                      {assessment::MedianDistance(object->viewpoints())});
    const double completeness = measures::Completeness(object->viewpoints(), directions, fitted.predicted, params.planner.rule);
    store.SaveMeasures(name, fitted, completeness);
    result["objects"].push_back(ToJson(*object, fitted, trials, completeness));
    summary << name << ": completeness " << completeness << " with " << object->views.size() << " views; p(o|theta) halves at "
            << fitted.predicted.HalfwayRotation() * 180.0 / M_PI << " degrees (" << trials.size() << " virtual views)\n";
  }
  WriteResult(options.common, result, summary.str());
}

// Photographs of one of the objects, with truth.
ReportTruth PhotographsOf(const AssessOptions& options, const model::ObjectModel& object, const params::LibraryParams& params) {
  const rgbd::BopScene scene(options.sequence);
  const RecordedObject known(scene, options.object_id);
  ReportTruth result;
  result.object = object.name;
  result.sequence = options.sequence;
  assessment::Truth truth;
  truth.T_mesh_object = MeshFromObject(scene, options.object_id, object);
  truth.points_in_mesh = truth.T_mesh_object * object.PointMatrix();
  truth.correct_m = params.trials.correct_m;
  for (const int id : FramesOf(scene, options.frames)) {
    const bool learned =
        std::any_of(object.views.begin(), object.views.end(), [id](const auto& view) { return view.frame_id == id; });
    if (learned) {
      throw std::runtime_error(options.store + ": '" + object.name + "' was learned from frame " + std::to_string(id) +
                               ", which judges; learn it with --frames even, or give other --frames");
    }
    result.frames.push_back(HoldOut(known.Load(id), known.TruePose(id), truth));
  }
  FindFeatures(params.recogniser, &result.frames);
  result.hypotheses =
      assessment::Hypotheses(std::make_shared<const model::ObjectModel>(object), truth, result.frames, params.recogniser);
  result.view_trials = assessment::TryViewsAlone(object, truth, result.frames, params.recogniser);
  return result;
}

// Trials of every object at even levels of noise and blur, kept in the folder; the store stays as it is.
void RunReport(const AssessOptions& options) {
  CheckOutput(options.common);
  params::LibraryParams params = LoadParams(options.common);
  params.trials.level_ratio = 1.0;
  const model::Store store(options.store, model::Store::Mode::kRead);
  const std::filesystem::path folder = options.report;
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) throw std::runtime_error(options.report + ": cannot be made: " + failed.message());
  Report report;
  report.recogniser = params.recogniser;
  report.observed_fit = params.trials.observed_fit;
  for (const std::string& name : NamesToAssess(options, store)) {
    const std::optional<model::ObjectModel> object = store.Load(name);
    if (!object || object->views.empty()) continue;
    auto backgrounds = BackgroundsFor(*object, options.backgrounds, store);
    ReportObject of;
    of.name = name;
    of.views = static_cast<int>(object->views.size());
    of.trials = KeptObjectTrials((folder / "trials").string(), *object, options.backgrounds, &backgrounds,
                                 options.images > 0 ? options.images : kReportImages, params);
    of.measures = assessment::FitMeasures(of.trials, params.recogniser, params.trials.observed_fit);
    report.objects.push_back(std::move(of));
  }
  if (report.objects.empty()) throw std::runtime_error(options.store + ": no object has views; learn one with vantage learn");
  if (!options.sequence.empty()) {
    const std::string name = options.truth_object.empty() ? report.objects.front().name : options.truth_object;
    const std::optional<model::ObjectModel> object = store.Load(name);
    if (!object) throw std::runtime_error(options.store + ": no object '" + name + "'; see vantage models list");
    report.truth = PhotographsOf(options, *object, params);
  }
  const std::vector<Observation> observations = Observe(report);
  SaveReport(report, observations, options.report);
  std::ostringstream summary;
  for (const Observation& one : observations) {
    summary << (one.agrees ? "agrees   " : "differs  ") << (one.object.empty() ? "" : one.object + ": ") << one.claim << " -- "
            << one.seen << '\n';
  }
  summary << (folder / "index.html").string() << '\n';
  WriteResult(options.common, {{"observations", ToJson(observations)}}, summary.str());
}

}  // namespace

void AddAssess(CLI::App& app, Run& run) {
  auto options = std::make_shared<AssessOptions>();
  CLI::App* verb =
      app.add_subcommand("assess", "Learn p(o|c) and p(o|theta) of stored objects from virtual views, and their completeness");
  AddCommonOptions(*verb, options->common);
  verb->add_option("--store", options->store, "The model store; the measures are saved in it")->required()->type_name("FILE");
  verb->add_option("--object", options->object, "Only this object (default: every one)")->type_name("NAME");
  verb->add_option("--backgrounds", options->backgrounds,
                   "Folder of images the virtual views are pasted over (default: what is around the object in its own views)")
      ->type_name("DIR");
  CLI::Option* images =
      verb->add_option("--images", options->images,
                       "So many virtual images an object, kept in FILE.trials as they come: a run that was stopped goes on from "
                       "there, and a model that grew needs its new views only")
          ->check(CLI::Range(1, 10000000))
          ->type_name("N");
  CLI::Option* full = verb->add_flag_callback(
                              "--full", [options] { options->images = kFullImages; },
                              "The paper's scale: --images 10000 (a quarter of an hour of one core an object)")
                          ->excludes(images);
  CLI::Option* predict =
      verb->add_option("--predict", options->predict,
                       "Learn nothing; say how likely this object would be detected from --from, by its measures")
          ->type_name("NAME")
          ->excludes(full);
  verb->add_option("--from", options->from, "Where the camera would stand, in the object's frame (metres), looking at it")
      ->delimiter(',')
      ->expected(3)
      ->needs(predict)
      ->type_name("X,Y,Z");
  CLI::Option* report =
      verb->add_option(
              "--report", options->report,
              "Save no measures; write DIR/index.html: the paper's plots and observations for these objects, from 1000 virtual "
              "images of each (or --images) at even levels of noise and blur, which are kept in DIR/trials")
          ->excludes(predict)
          ->type_name("DIR");
  CLI::Option* sequence =
      verb->add_option("--sequence", options->sequence, "With photographs of one of the objects: BOP scene folder with its truth")
          ->needs(report)
          ->type_name("DIR");
  CLI::Option* object_id = verb->add_option("--object-id", options->object_id, "The object of its scene_gt.json")
                               ->needs(sequence)
                               ->check(CLI::Range(1, 1000000))
                               ->type_name("N");
  sequence->needs(object_id);
  verb->add_option("--truth-object", options->truth_object, "Its name in the store (default: the first)")
      ->needs(sequence)
      ->type_name("NAME");
  verb->add_option("--frames", options->frames, "Frames that judge: all, even, odd, or A:B")
      ->needs(sequence)
      ->capture_default_str();
  verb->callback([options, &run] {
    if (!options->predict.empty() && options->from.size() != 3) throw CLI::ValidationError("--predict", "needs --from X,Y,Z");
    run = [options] {
      if (!options->report.empty()) return RunReport(*options);
      options->predict.empty() ? RunAssess(*options) : RunPredict(*options);
    };
  });
}

}  // namespace vantage::cli
