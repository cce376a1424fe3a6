// vantage evaluate calibration: whether probabilities learned from virtual views hold in frames nothing was learned from.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>

#include "vantage/calibration_trial.h"

namespace vantage::cli {
namespace {

struct Options {
  CommonOptions common;
  CalibrationOptions trial;
  std::vector<std::string> meshes;
  bool quick = false;
  std::string out;
};

// A table and walls with photographs on them: what is around an object is not plain.
simulation::WorldParams SimulatedRoom(const std::string& mesh) {
  simulation::WorldParams room;
  room.table_texture = "fruits.jpg";
  room.table_tile_m = 0.6;
  room.wall_texture = "leuvenA.jpg";
  return simulation::WorldWithMeshes(room, {mesh});
}

Json Try(const CalibrationOptions& options, const params::LibraryParams& params, const std::string& out) {
  const CalibrationTrial trial = TryCalibration(options, params, [](int done, int of) {
    std::cerr << "\r" << done << " of " << of << " models" << (done == of ? "\n" : "") << std::flush;
  });
  Json figures = FiguresOf(trial, options.seed);
  figures["seed"] = options.seed;
  if (!out.empty()) SaveCalibration(trial, figures, out);
  return figures;
}

void RunEvaluateCalibration(const Options& options) {
  CheckOutput(options.common);
  params::LibraryParams params = LoadParams(options.common);
  CalibrationOptions trial_options = options.trial;
  trial_options.seed = options.common.seed;
  if (options.quick) {
    trial_options.views = {2, 8};
    trial_options.draws = 2;
    trial_options.max_trials = 48;
    trial_options.absent_step = 4;
  }
  if (options.meshes.empty()) {
    if (trial_options.folder.empty()) throw std::runtime_error("say of what: --sequence DIR --object-id N, or --mesh FILE[,...]");
    if (trial_options.object_id == 0) throw std::runtime_error("--sequence needs --object-id N");
    const Json figures = Try(trial_options, params, options.out);
    return WriteResult(options.common, figures, TableOf(figures));
  }
  Json objects = Json::array();
  std::string text;
  for (const std::string& mesh : options.meshes) {
    trial_options.world = SimulatedRoom(mesh);
    const std::string name = trial_options.world->objects.front().name;
    std::cerr << name << ":\n";
    Json figures = Try(trial_options, params, options.out.empty() ? "" : (std::filesystem::path(options.out) / name).string());
    text += name + "\n" + TableOf(figures);
    figures["object"] = name;
    objects.push_back(std::move(figures));
  }
  WriteResult(options.common, {{"objects", objects}}, text);
}

}  // namespace

void AddEvaluateCalibration(CLI::App& evaluate, Run& run) {
  auto options = std::make_shared<Options>();
  CLI::App* verb = evaluate.add_subcommand(
      "calibration", "Measures learned from virtual views alone, held against frames of a recording that nothing was learned from");
  AddCommonOptions(*verb, options->common);
  CLI::Option* sequence = verb->add_option("--sequence", options->trial.folder,
                                           "BOP scene folder with depth, labels and truth: even ids teach, odd ids judge")
                              ->type_name("DIR");
  CLI::Option* mesh =
      verb->add_option(
              "--mesh", options->meshes,
              "Instead: objects on a simulated table, one after another, each seen 96 times by a Kinect; half of the looks "
              "teach, half judge with the object carried elsewhere, and again with it gone")
          ->delimiter(',')
          ->excludes(sequence)
          ->check(CLI::ExistingFile)
          ->type_name("FILE[,...]");
  verb->add_option("--turned", options->trial.turned_deg,
                   "It is turned by so much, too, under a lamp that gives 0.45 of the light (see trials.lamp_share)")
      ->check(CLI::Range(-360.0, 360.0))
      ->needs(mesh)
      ->type_name("DEG");
  verb->add_option("--object-id", options->trial.object_id, "The object of scene_gt.json that is learned and looked for")
      ->check(CLI::Range(1, 1000000))
      ->type_name("N");
  CLI::Option* store =
      verb->add_option("--store", options->trial.store,
                       "Judge the measures stored with this store's one object, learned from even ids (default: models are drawn)")
          ->type_name("FILE");
  verb->add_option("--views", options->trial.views, "Views of the models that are drawn")
      ->delimiter(',')
      ->check(CLI::Range(1, 1000))
      ->capture_default_str()
      ->excludes(store);
  verb->add_option("--draws", options->trial.draws, "Models for each number of views")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str()
      ->excludes(store);
  verb->add_option("--max-trials", options->trial.max_trials,
                   "Virtual images with the object for each model, at most trials_per_view for each view")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str()
      ->excludes(store);
  verb->add_option("--absent", options->trial.absent, "Recordings that do not show the object: every hypothesis there is wrong")
      ->delimiter(',')
      ->type_name("DIR[,...]");
  verb->add_flag("--tune", options->trial.tune,
                 "For choosing parameters: of the even ids every other one teaches and the rest judge; odd ids are not looked at");
  verb->add_flag("--quick", options->quick, "2 models each of 2 and 8 views, few virtual images");
  verb->add_option(
          "--out", options->out,
          "Write figures.json, hypotheses.csv, views.csv, trials.csv, models.csv and reliability.png (where gnuplot is found)")
      ->type_name("DIR");
  verb->callback([options, &run] { run = [options] { RunEvaluateCalibration(*options); }; });
}

}  // namespace vantage::cli
