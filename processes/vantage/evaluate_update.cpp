// vantage evaluate update: what the assessor process does after every new view, how long it takes on one core, and how far its
// measures are from those of many more virtual images.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <ctime>
#include <iostream>
#include <opencv2/core/utility.hpp>
#include <sstream>

#include "assessor/worker.h"
#include "rgbd/bop.h"
#include "vantage/object_trials.h"
#include "vantage/truth_judge.h"
#include "vantage/verb.h"

namespace vantage::cli {
namespace {

struct Options {
  CommonOptions common;
  std::string store;
  std::string folder;  // The recording it was learned from.
  int images = 10000;
  bool quick = false;
};

struct Updates {
  std::vector<double> cpu_s, wall_s;  // Of each view, until it counts.
  double rest_cpu_s = 0.0;            // Of all views, for the rest of their trials.
  measures::Measures measures;        // When the last view came to count, and no view had had all its trials.
  measures::Measures finished;        // When all trials were done.
  std::vector<assessment::Background> backgrounds;
};

assessor::Assessment NextPart(assessor::Worker& worker, const std::string& object, std::optional<rgbd::Frame> frame) {
  worker.Start(object, std::move(frame));
  worker.WaitUntilDone();
  const auto assessed = worker.Poll();
  if (!assessed) throw std::runtime_error(object + ": no result");
  if (!assessed->error.empty()) throw std::runtime_error(assessed->error);
  return *assessed;
}

double SecondsSince(std::clock_t start) { return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC; }

// View by view, as the views had come quickly one after another, each with the whole frame it was learned from: backgrounds come of
// them.
Updates Update(const std::string& store, const model::ObjectModel& object, const rgbd::BopScene& scene,
               const params::LibraryParams& params) {
  assessor::WorkerParams worker_params;
  worker_params.store = store;
  worker_params.recogniser = params.recogniser;
  worker_params.trials = params.trials;
  worker_params.plane = params.learner.plane;
  worker_params.clusters = params.learner.clusters;
  assessor::Worker worker(worker_params);
  Updates updates;
  for (std::size_t view = 0; view < object.views.size(); ++view) {
    const rgbd::Frame frame = scene.Load(static_cast<int>(object.views[view].frame_id));
    const std::clock_t cpu = std::clock();
    const auto wall = std::chrono::steady_clock::now();
    updates.measures = NextPart(worker, object.name, frame).measures;
    updates.cpu_s.push_back(SecondsSince(cpu));
    updates.wall_s.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - wall).count());
    std::cerr << "\rview " << view + 1 << " of " << object.views.size() << std::flush;
  }
  std::cerr << "; the rest of their trials" << std::flush;
  const std::clock_t cpu = std::clock();
  for (bool finished = false; !finished;) {
    const assessor::Assessment assessed = NextPart(worker, object.name, std::nullopt);
    updates.finished = assessed.measures;
    finished = assessed.finished;
  }
  updates.rest_cpu_s = SecondsSince(cpu);
  std::cerr << '\n';
  updates.backgrounds = worker.backgrounds();
  return updates;
}

Json Seconds(const std::vector<double>& seconds) { return {{"median", Quantile(seconds, 0.5)}, {"max", Quantile(seconds, 1.0)}}; }

void RunEvaluateUpdate(const Options& options) {
  CheckOutput(options.common);
  const params::LibraryParams params = LoadParams(options.common);
  const model::ObjectModel object = OnlyObjectOf(options.store);
  const rgbd::BopScene scene(options.folder);
  cv::setNumThreads(1);
  Updates updates = Update(options.store, object, scene, params);
  cv::setNumThreads(-1);
  const auto trials = KeptObjectTrials(options.store + ".trials", object, options.folder, &updates.backgrounds,
                                       options.quick ? 400 : options.images, params);
  const measures::Measures full = assessment::FitMeasures(trials, params.recogniser, params.trials.observed_fit);

  const auto viewpoints = object.viewpoints();
  const auto directions = assessment::UniformViewpoints(params.candidates.min_elevation_rad, params.candidates.max_elevation_rad,
                                                        {assessment::MedianDistance(viewpoints)});
  const auto completeness = [&](const measures::Measures& of) {
    return measures::Completeness(viewpoints, directions, of.predicted, params.planner.rule);
  };
  const auto observed_difference = [&](const measures::Measures& of) {
    double largest = 0.0;
    for (double c = 0.0; c <= 1.0; c += 0.01) {
      largest = std::max(largest, std::abs(of.observed.Probability(c) - full.observed.Probability(c)));
    }
    return largest;
  };
  const auto figures = [&](const measures::Measures& of) -> Json {
    return {{"completeness", completeness(of)},
            {"observed_largest_difference", observed_difference(of)},
            {"halfway_deg", of.predicted.HalfwayRotation() * 180.0 / M_PI}};
  };
  const double rest_cpu_s = updates.rest_cpu_s / static_cast<double>(object.views.size());
  const Json result = {{"object", object.name},
                       {"views", object.views.size()},
                       {"cpu_s", Seconds(updates.cpu_s)},
                       {"rest_cpu_s", rest_cpu_s},
                       {"wall_s", Seconds(updates.wall_s)},
                       {"images_full", trials.size()},
                       {"counted", figures(updates.measures)},
                       {"finished", figures(updates.finished)},
                       {"full", figures(full)}};
  std::ostringstream text;
  text.precision(3);
  text << object.name << ", " << object.views.size() << " views one after another: " << Quantile(updates.cpu_s, 0.5)
       << " s of one core until a view counts (at most " << Quantile(updates.cpu_s, 1.0) << "; wall "
       << Quantile(updates.wall_s, 0.5) << ", " << Quantile(updates.wall_s, 1.0) << "), " << rest_cpu_s
       << " s for the rest of its trials\n";
  const auto line = [&](const std::string& when, const measures::Measures& of) {
    text << when << ": completeness " << completeness(of) << ", p(o|c) differs by " << observed_difference(of)
         << " at most, p(o|theta) halves at " << of.predicted.HalfwayRotation() * 180.0 / M_PI << " degrees\n";
  };
  line("when all views count", updates.measures);
  line("when all trials are done", updates.finished);
  line("by " + std::to_string(trials.size()) + " virtual images", full);
  WriteResult(options.common, result, text.str());
}

}  // namespace

void AddEvaluateUpdate(CLI::App& evaluate, Run& run) {
  auto options = std::make_shared<Options>();
  CLI::App* verb = evaluate.add_subcommand(
      "update",
      "The assessor's work after every new view: seconds of one core, and its measures beside those of --images virtual images");
  AddCommonOptions(*verb, options->common);
  verb->add_option("--store", options->store, "A store with one object")->required()->type_name("FILE");
  verb->add_option("--sequence", options->folder, "The recording it was learned from: BOP scene folder")
      ->required()
      ->type_name("DIR");
  verb->add_option("--images", options->images,
                   "Virtual images of the full result, kept in FILE.trials as vantage assess keeps them")
      ->check(CLI::Range(1, 10000000))
      ->capture_default_str();
  verb->add_flag("--quick", options->quick, "400 virtual images");
  verb->callback([options, &run] { run = [options] { RunEvaluateUpdate(*options); }; });
}

}  // namespace vantage::cli
