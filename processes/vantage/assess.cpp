// vantage assess: learns an object's measures from virtual views of its stored model, and how complete the model is.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "assessment/assessor.h"
#include "assessment/background.h"
#include "geometry/view_sphere.h"
#include "model/store.h"
#include "vantage/trial_record.h"
#include "vantage/verb.h"

namespace vantage::cli {
namespace {

constexpr int kFullImages = 10000;            // An object; the paper's scale.
constexpr std::size_t kFullBackgrounds = 16;  // Interest points of each are found once for every view.

struct AssessOptions {
  CommonOptions common;
  std::string store;
  std::string object;        // Empty = every one.
  std::string backgrounds;   // Folder of images; empty = what is around the objects in their own views.
  int images = 0;            // Virtual images an object, kept on disk; 0 = as many as the parameters say, not kept.
  std::string predict;       // Only say how likely this object would be detected...
  std::vector<double> from;  // ...from this place of the camera in the object's frame, metres.
};

// The folder's images by name; other files are passed over.
std::vector<cv::Mat> ReadBackgrounds(const std::filesystem::path& folder) {
  if (!std::filesystem::is_directory(folder)) throw std::runtime_error(folder.string() + ": no such folder of background images");
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.is_regular_file() && cv::haveImageReader(entry.path().string())) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  std::vector<cv::Mat> images;
  for (const std::filesystem::path& file : files) {
    cv::Mat image = cv::imread(file.string(), cv::IMREAD_COLOR);
    if (!image.empty()) images.push_back(std::move(image));
  }
  if (images.empty()) throw std::runtime_error(folder.string() + ": holds no images that can be read");
  return images;
}

std::vector<cv::Mat> OwnBackgrounds(const model::ObjectModel& object) {
  std::vector<cv::Mat> images;
  for (const model::View& view : object.views) {
    if (!view.mask.empty()) images.push_back(assessment::MaskedBackground(view.keyframe.color, view.mask));
  }
  return images;
}

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

void Tell(const std::string& name, int done, int of) {
  if (done % 10 == 0 || done == of) std::cerr << '\r' << name << ": " << done << " of " << of << " virtual images" << std::flush;
  if (done == of) std::cerr << '\n';
}

// Evenly chosen.
std::vector<cv::Mat> AtMost(std::size_t count, const std::vector<cv::Mat>& images) {
  std::vector<cv::Mat> chosen;
  for (std::size_t i = 0; i < std::min(count, images.size()); ++i) {
    chosen.push_back(images[i * images.size() / std::min(count, images.size())]);
  }
  return chosen;
}

// What kept trials hold for: all that they depend on but their number.
std::string KeyOf(const AssessOptions& options, const std::string& object, const params::LibraryParams& params) {
  std::string key = object + "|" + options.backgrounds;
  for (const auto& [name, value] : params::Flatten(params)) {
    const bool of_trials = name.rfind("recogniser.", 0) == 0 || name.rfind("trials.", 0) == 0;
    if (of_trials && name != "trials.trials_per_view" && name != "trials.observed_fit") key += "|" + name + "=" + value;
  }
  return key;
}

int Shown(const std::vector<assessment::Trial>& trials) {
  return static_cast<int>(
      std::count_if(trials.begin(), trials.end(), [](const assessment::Trial& one) { return one.object_shown; }));
}

// View by view, each with those before it as the assessor process has them, and each on disk before the next. A view that has
// enough trials keeps all of them.
std::vector<assessment::Trial> KeptTrials(const AssessOptions& options, const model::ObjectModel& object,
                                          const std::vector<cv::Mat>& all_backgrounds, const params::LibraryParams& params) {
  const std::vector<cv::Mat> backgrounds = AtMost(kFullBackgrounds, all_backgrounds);
  const int views = static_cast<int>(object.views.size());
  assessment::TrialParams trials = params.trials;
  trials.trials_per_view = std::max(1, (options.images + views - 1) / views - trials.negatives_per_view);
  TrialRecord record(options.store + ".trials", KeyOf(options, object.name, params));
  std::vector<assessment::Trial> result;
  std::vector<int> so_far;
  for (int view = 0; view < views; ++view) {
    so_far.push_back(view);
    const model::View& learned = object.views[static_cast<std::size_t>(view)];
    if (learned.points.empty() || learned.keyframe.depth.empty()) continue;  // Nothing that could be shown or recognised.
    const auto* known = record.Find(learned.id, learned.utime);
    if (known == nullptr || Shown(*known) < trials.trials_per_view) {
      const std::string name = object.name + ", view " + std::to_string(view + 1) + " of " + std::to_string(views);
      record.Add(learned.id, learned.utime,
                 assessment::RunTrials(object.OnlyViews(so_far), view, backgrounds, params.recogniser, trials,
                                       [&](int done, int of) { Tell(name, done, of); }));
      known = record.Find(learned.id, learned.utime);
    }
    result.insert(result.end(), known->begin(), known->end());
  }
  return result;
}

std::vector<assessment::Trial> TrialsOf(const AssessOptions& options, const model::ObjectModel& object,
                                        const std::vector<cv::Mat>& backgrounds, const params::LibraryParams& params) {
  if (options.images > 0) return KeptTrials(options, object, backgrounds, params);
  return assessment::RunTrials(object, 0, backgrounds, params.recogniser, params.trials,
                               [&](int done, int of) { Tell(object.name, done, of); });
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
  const std::vector<cv::Mat> backgrounds =
      options.backgrounds.empty() ? std::vector<cv::Mat>() : ReadBackgrounds(options.backgrounds);

  Json result;
  result["store"] = options.store;
  result["objects"] = Json::array();
  std::ostringstream summary;
  summary.precision(3);
  for (const std::string& name : names) {
    const std::optional<model::ObjectModel> object = store.Load(name);
    if (!object) throw std::runtime_error(options.store + ": object '" + name + "' was removed meanwhile");
    if (object->views.empty()) throw std::runtime_error(options.store + ": object '" + name + "' has no views; learn it again");
    const std::vector<assessment::Trial> trials =
        TrialsOf(options, *object, options.backgrounds.empty() ? OwnBackgrounds(*object) : backgrounds, params);
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
  verb->callback([options, &run] {
    if (!options->predict.empty() && options->from.size() != 3) throw CLI::ValidationError("--predict", "needs --from X,Y,Z");
    run = [options] { options->predict.empty() ? RunAssess(*options) : RunPredict(*options); };
  });
}

}  // namespace vantage::cli
