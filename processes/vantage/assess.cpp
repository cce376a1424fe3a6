// vantage assess: learns an object's measures from virtual views of its stored model, and how complete the model is.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "assessment/assessor.h"
#include "assessment/background.h"
#include "model/store.h"
#include "vantage/verb.h"

namespace vantage::cli {
namespace {

struct AssessOptions {
  CommonOptions common;
  std::string store;
  std::string object;       // Empty = every one.
  std::string backgrounds;  // Folder of images; empty = what is around the objects in their own views.
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

double MedianDistance(const model::ObjectModel& object) {
  std::vector<double> distances_m;
  for (const measures::Viewpoint& viewpoint : object.viewpoints()) distances_m.push_back(viewpoint.distance_m);
  return Quantile(distances_m, 0.5);
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
    const std::vector<assessment::Trial> trials = assessment::RunTrials(
        *object, 0, options.backgrounds.empty() ? OwnBackgrounds(*object) : backgrounds, params.recogniser, params.trials);
    const measures::Measures fitted = assessment::FitMeasures(trials, params.recogniser, params.trials.observed_fit);
    const std::vector<measures::WeightedViewpoint> directions = assessment::UniformViewpoints(
        params.candidates.min_elevation_rad, params.candidates.max_elevation_rad, {MedianDistance(*object)});
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
  verb->callback([options, &run] { run = [options] { RunAssess(*options); }; });
}

}  // namespace vantage::cli
