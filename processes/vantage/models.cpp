// vantage models: what a store holds.
#include <CLI/CLI.hpp>
#include <sstream>

#include "measures/text.h"
#include "model/store.h"
#include "vantage/verb.h"

namespace vantage::cli {
namespace {

struct ModelsOptions {
  CommonOptions common;
  std::string store;
  std::string object;
};

Json OrNull(const std::optional<double>& value) { return value ? Number(*value) : Json(nullptr); }

void RunList(const ModelsOptions& options) {
  CheckOutput(options.common);
  const model::Store store(options.store, model::Store::Mode::kRead);
  Json result;
  result["store"] = options.store;
  result["objects"] = Json::array();
  std::ostringstream summary;
  summary.precision(3);
  for (const model::Store::Summary& object : store.List()) {
    const std::optional<double> completeness = store.Completeness(object.name);
    Json entry;
    entry["name"] = object.name;
    entry["views"] = object.views;
    entry["points"] = object.points;
    entry["revision"] = object.revision;
    entry["utime"] = object.utime;
    entry["completeness"] = OrNull(completeness);
    result["objects"].push_back(std::move(entry));
    summary << object.name << ": " << object.views << " views, " << object.points << " points";
    if (completeness) summary << ", completeness " << *completeness;
    summary << '\n';
  }
  if (result["objects"].empty()) summary << "no objects in " << options.store << '\n';
  WriteResult(options.common, result, summary.str());
}

Json ToJson(const model::View& view) {
  const measures::Viewpoint viewpoint = view.viewpoint();
  Json entry;
  entry["id"] = view.id;
  entry["frame_id"] = view.frame_id;
  entry["utime"] = view.utime;
  entry["keypoints"] = view.features.size();
  entry["direction"] = {viewpoint.direction.x(), viewpoint.direction.y(), viewpoint.direction.z()};
  entry["distance_m"] = viewpoint.distance_m;
  entry["T_camera_object"] = cli::ToJson(view.T_camera_object);
  return entry;
}

void RunShow(const ModelsOptions& options) {
  CheckOutput(options.common);
  const model::Store store(options.store, model::Store::Mode::kRead);
  const std::optional<model::ObjectModel> object = store.Load(options.object);
  if (!object) throw std::runtime_error(options.store + ": no object '" + options.object + "'; see vantage models list");
  const std::optional<double> completeness = store.Completeness(options.object);
  Json result;
  result["name"] = object->name;
  result["points"] = object->points.size();
  result["features"] = object->feature_fingerprint;
  result["completeness"] = OrNull(completeness);
  result["measures"] = Json::parse(measures::ToText(object->measures));
  result["views"] = Json::array();
  std::ostringstream summary;
  summary.precision(3);
  summary << object->name << ": " << object->views.size() << " views, " << object->points.size() << " points, completeness ";
  if (completeness) {
    summary << *completeness;
  } else {
    summary << "not assessed";
  }
  summary << '\n';
  for (const model::View& view : object->views) {
    result["views"].push_back(ToJson(view));
    const measures::Viewpoint viewpoint = view.viewpoint();
    summary << "  view " << view.id << ": frame " << view.frame_id << ", " << view.features.size()
            << " interest points, seen from [" << viewpoint.direction.transpose() << "] at " << viewpoint.distance_m << " m\n";
  }
  WriteResult(options.common, result, summary.str());
}

}  // namespace

void AddModels(CLI::App& app, Run& run) {
  CLI::App* verb = app.add_subcommand("models", "What a store holds");
  verb->require_subcommand(1);
  auto options = std::make_shared<ModelsOptions>();
  CLI::App* list = verb->add_subcommand("list", "Every object, with views, points and completeness");
  CLI::App* show = verb->add_subcommand("show", "One object: its views and measures");
  for (CLI::App* action : {list, show}) {
    AddCommonOptions(*action, options->common);
    action->add_option("--store", options->store, "The model store")->required()->type_name("FILE");
  }
  show->add_option("--object,object", options->object, "Name of the object")->required()->type_name("NAME");
  list->callback([options, &run] { run = [options] { RunList(*options); }; });
  show->callback([options, &run] { run = [options] { RunShow(*options); }; });
}

}  // namespace vantage::cli
