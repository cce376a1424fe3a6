// vantage evaluate recogniser: many objects among each other, and objects that are not there.
#include <CLI/CLI.hpp>
#include <array>
#include <filesystem>
#include <sstream>

#include "model/store.h"
#include "rgbd/bop.h"
#include "vantage/clutter_trial.h"
#include "vantage/overlay.h"
#include "vantage/sequence.h"
#include "vantage/verb.h"

namespace vantage::cli {
namespace {

namespace fs = std::filesystem;

struct EvaluateOptions {
  CommonOptions common;
  std::string world;
  std::string store;
  std::vector<std::string> absent;
  int arrangements = 0;  // 0 = ClutterParams'.
  int looks = 0;
  bool quick = false;
  std::string save;
};

constexpr double kDetected = 0.5;  // p(o|c) from which a detection counts.
constexpr std::array<double, 7> kBinEdges = {0.0, 0.1, 0.3, 0.45, 0.6, 0.8, 1.0};

// Sightings whose occlusion lies in [from, to).
struct Bin {
  double from = 0.0, to = 1.0;
  int objects = 0, found = 0, right = 0, wrong = 0;

  void Add(const Sighting& sighting) {
    ++objects;
    found += sighting.right > 0;
    right += sighting.right;
    wrong += sighting.wrong;
  }
  double recall() const { return objects > 0 ? double(found) / objects : std::nan(""); }
  double precision() const { return right + wrong > 0 ? double(right) / (right + wrong) : std::nan(""); }
  Json ToJson() const {
    return {{"occlusion_from", from},     {"occlusion_to", to},          {"objects", objects}, {"found", found},
            {"recall", Number(recall())}, {"detections", right + wrong}, {"wrong", wrong},     {"precision", Number(precision())}};
  }
};

struct ClutterFigures {
  std::vector<Bin> bins;
  Bin all;
  int wrong_elsewhere = 0;  // Of objects that are not judged where they are said to be: mostly outside the image.
  int best_right = 0;       // In one frame.
  int own_right = 0;        // In the frame from the world's start pose.
  std::vector<double> ms;

  ClutterFigures() {
    for (size_t i = 0; i + 1 < kBinEdges.size(); ++i) bins.push_back({kBinEdges[i], kBinEdges[i + 1]});
  }
  void Add(const ClutterFrame& frame) {
    for (const Sighting& sighting : frame.sightings) {
      if (!sighting.judged) {
        wrong_elsewhere += sighting.wrong;
        continue;
      }
      all.Add(sighting);
      for (Bin& bin : bins) {
        const bool last = bin.to >= 1.0;
        if (sighting.occlusion >= bin.from && (sighting.occlusion < bin.to || last)) bin.Add(sighting);
      }
    }
    best_right = std::max(best_right, frame.right());
    if (frame.arrangement == 0 && frame.look == 0) own_right = frame.right();
    ms.push_back(frame.ms);
  }
};

Json ToJson(const ClutterFigures& figures, int objects) {
  Json result;
  result["objects"] = objects;
  result["frames"] = figures.ms.size();
  result["occlusion"] = Json::array();
  for (const Bin& bin : figures.bins) result["occlusion"].push_back(bin.ToJson());
  result["all"] = figures.all.ToJson();
  result["wrong_elsewhere"] = figures.wrong_elsewhere;
  result["right_in_start_frame"] = figures.own_right;
  result["most_right_in_one_frame"] = figures.best_right;
  result["ms_median"] = Number(Quantile(figures.ms, 0.5));
  return result;
}

std::string SummaryOf(const ClutterFigures& figures, int objects) {
  std::ostringstream text;
  text.precision(3);
  text << objects << " objects, " << figures.ms.size() << " frames, " << Quantile(figures.ms, 0.5) << " ms each\n";
  text << "occlusion     objects  found  recall  detections  wrong  precision\n";
  const auto row = [&text](const std::string& name, const Bin& bin) {
    char line[160];
    std::snprintf(line, sizeof line, "%-12s %8d %6d %7.3f %11d %6d %10.3f\n", name.c_str(), bin.objects, bin.found, bin.recall(),
                  bin.right + bin.wrong, bin.wrong, bin.precision());
    text << line;
  };
  for (const Bin& bin : figures.bins) {
    char name[32];
    std::snprintf(name, sizeof name, "%.2f - %.2f", bin.from, bin.to);
    row(name, bin);
  }
  row("all", figures.all);
  text << figures.own_right << " right in the frame from the start pose, at most " << figures.best_right << " in one frame; "
       << figures.wrong_elsewhere << " wrong detections of objects outside the image\n";
  return text.str();
}

void SaveOverlay(const EvaluateOptions& options, const ClutterFrame& frame, const cv::Mat& overlay) {
  if (options.save.empty()) return;
  const std::string name = "overlay_" + std::to_string(frame.arrangement) + "_" + std::to_string(frame.look) + ".png";
  WritePicture((fs::path(options.save) / name).string(), overlay);
}

void EvaluateClutter(const EvaluateOptions& options, const params::LibraryParams& params, Json& result, std::string& summary) {
  ClutterParams clutter;
  clutter.seed = options.common.seed;
  simulation::WorldParams world = simulation::LoadWorldParams(options.world);
  if (world.objects.empty()) throw std::runtime_error(options.world + ": has no objects");
  if (options.quick) {
    clutter.arrangements = 1;
    clutter.looks = 1;
    clutter.learning_azimuths = 6;
    clutter.learning_elevations_deg = {30.0};
  }
  if (options.arrangements > 0) clutter.arrangements = options.arrangements;
  if (options.looks > 0) clutter.looks = options.looks;
  ClutterTrial trial(world, params.recogniser, clutter);
  trial.Learn(options.store);
  ClutterFigures figures;
  for (int arrangement = 0; arrangement < clutter.arrangements; ++arrangement) {
    for (int look = 0; look < clutter.looks; ++look) {
      cv::Mat overlay;
      const ClutterFrame frame = trial.Look(arrangement, look, &overlay);
      figures.Add(frame);
      SaveOverlay(options, frame, overlay);
    }
  }
  result["clutter"] = ToJson(figures, trial.objects());
  summary += SummaryOf(figures, trial.objects());
}

// Every object of the store, held to frames that show none of them.
void EvaluateAbsent(const EvaluateOptions& options, const params::LibraryParams& params, Json& result, std::string& summary) {
  recognition::Recogniser recogniser(params.recogniser);
  const model::Store store(options.store, model::Store::Mode::kRead);
  for (const auto& entry : store.List()) {
    if (auto object = store.Load(entry.name)) recogniser.Set(std::make_shared<const model::ObjectModel>(std::move(*object)));
  }
  if (recogniser.size() == 0) throw std::runtime_error(options.store + ": holds no objects; learn one with vantage learn");
  int frames = 0, hypotheses = 0, wrong = 0;
  double most = 0.0;
  for (const std::string& folder : options.absent) {
    const rgbd::BopScene scene(folder);
    for (const int id : FramesOf(scene, "all")) {
      const rgbd::Frame frame = scene.Load(id);
      const auto detections = recogniser.Recognise(frame, recogniser.Extract(frame));
      ++frames;
      bool shown = false;
      for (const recognition::Detection& detection : detections) {
        ++hypotheses;
        most = std::max(most, detection.probability);
        wrong += detection.probability >= kDetected;
        shown |= detection.probability >= kDetected;
      }
      if (shown && !options.save.empty()) {
        const std::string name = "absent_" + NameOfFolder(folder) + "_" + std::to_string(id) + ".png";
        WritePicture((fs::path(options.save) / name).string(), DrawDetections(frame, detections));
      }
    }
  }
  Json& absent = result["absent"];
  absent["objects"] = recogniser.size();
  absent["frames"] = frames;
  absent["hypotheses"] = hypotheses;
  absent["detections"] = wrong;
  absent["largest_probability"] = Number(most);
  std::ostringstream text;
  text.precision(3);
  text << "absent: " << wrong << " detections with p >= 0.5 of " << recogniser.size() << " objects in " << frames
       << " frames without them (" << hypotheses << " hypotheses, largest p " << most << ")\n";
  summary += text.str();
}

void RunEvaluateRecogniser(const EvaluateOptions& options) {
  CheckOutput(options.common);
  if (options.world.empty() && options.absent.empty()) {
    throw std::runtime_error("say what to hold the recogniser against: --world FILE, or --store FILE with --absent DIR");
  }
  if (!options.absent.empty() && options.store.empty()) throw std::runtime_error("--absent needs --store with the objects");
  if (!options.save.empty()) fs::create_directories(options.save);
  const params::LibraryParams params = LoadParams(options.common);
  Json result;
  result["seed"] = options.common.seed;
  std::string summary;
  if (!options.world.empty()) EvaluateClutter(options, params, result, summary);
  if (!options.absent.empty()) EvaluateAbsent(options, params, result, summary);
  WriteResult(options.common, result, summary);
}

}  // namespace

void AddEvaluateRecogniser(CLI::App& evaluate, Run& run) {
  auto options = std::make_shared<EvaluateOptions>();
  CLI::App* verb = evaluate.add_subcommand(
      "recogniser", "Many objects on one simulated table (recall and precision over occlusion), and objects that are not there");
  AddCommonOptions(*verb, options->common);
  verb->add_option("--world", options->world, "A crowded table, as config/worlds/clutter.yaml: its objects are learned, then found")
      ->type_name("FILE");
  verb->add_option("--store", options->store,
                   "With --world: objects of the world it lacks are learned into it; with --absent: the objects")
      ->type_name("FILE");
  verb->add_option("--absent", options->absent, "BOP scene folders, parted by commas, that show none of the store's objects")
      ->delimiter(',')
      ->type_name("DIR[,...]");
  verb->add_option("--arrangements", options->arrangements,
                   "With --world: the world's own, and so many less one with places changed")
      ->check(CLI::Range(1, 100000))
      ->type_name("N");
  verb->add_option("--looks", options->looks, "Frames of every arrangement; the first from the start pose")
      ->check(CLI::Range(1, 100000))
      ->type_name("N");
  verb->add_flag("--quick", options->quick, "Few learned views, and the frame from the start pose only");
  verb->add_option("--save", options->save, "Write pictures with the convex hulls of the matched points here")->type_name("DIR");
  verb->callback([options, &run] { run = [options] { RunEvaluateRecogniser(*options); }; });
}

}  // namespace vantage::cli
