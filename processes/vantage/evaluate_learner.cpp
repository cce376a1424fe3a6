// vantage evaluate learner: the learner on simulated orbits with the Kinect error model.
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <sstream>

#include "simulation/orbit_sequence.h"
#include "vantage/learner_trial.h"
#include "vantage/pose_witness.h"
#include "vantage/sequence_trial.h"

namespace vantage::cli {
namespace {

namespace fs = std::filesystem;

struct LearnerOptions {
  CommonOptions common;
  std::string world;
  std::vector<std::string> meshes;
  std::string swapped_for;
  std::string fault = "none";
  std::optional<double> fault_start_s;  // None = as the orbit's default.
  double fault_turn_share = simulation::FaultParams().turn_share;
  int frames = 0;   // 0 = all of the orbit.
  int circles = 0;  // 0 = one at each elevation.
  bool quick = false;
  std::optional<double> start_azimuth_deg;  // None = before the broadest side.
  bool tell_poses = false;
  std::string save;
  SequenceTrialOptions sequence;
};

constexpr int kPictureEvery = 90;
constexpr int kReplacedEvery = 5;  // Every n-th frame of a second of interest is placed anew.
constexpr double kSecond_s = 1.0;

// "003_cracker_box", a folder with textured.obj, or a file.
fs::path MeshFile(const std::string& name) {
  std::vector<fs::path> candidates = {name, fs::path(name) / "textured.obj"};
  if (const char* data = std::getenv("VANTAGE_DATA")) candidates.push_back(fs::path(data) / "meshes" / name / "textured.obj");
  for (const fs::path& file : candidates) {
    if (fs::is_regular_file(file)) return file;
  }
  throw std::runtime_error("--mesh " + name + ": neither a file nor a folder with textured.obj, nor in meshes/ of $VANTAGE_DATA");
}

// From where the object looks broadest (the first of the directions), degrees about the world's z from x, in steps of 5.
double BroadestSide_deg(const simulation::TrueObject& object) {
  const Eigen::Matrix3Xd points = object.T_world_object * object.points;
  double broadest_m = 0.0, azimuth_deg = 0.0;
  for (int degrees = 0; degrees < 180; degrees += 5) {
    const double azimuth = degrees * M_PI / 180.0;
    const Eigen::RowVectorXd across = Eigen::RowVector3d(-std::sin(azimuth), std::cos(azimuth), 0.0) * points;
    const double width_m = across.maxCoeff() - across.minCoeff();
    if (width_m > broadest_m + 1e-3) {
      broadest_m = width_m;
      azimuth_deg = degrees;
    }
  }
  return azimuth_deg;
}

simulation::SequenceParams SequenceOf(const LearnerOptions& options, const simulation::World& world) {
  simulation::SequenceParams params;
  params.seed = params.orbit.seed = options.common.seed;
  params.tell_camera_pose = options.tell_poses;
  params.orbit.start_azimuth_deg = options.start_azimuth_deg.value_or(BroadestSide_deg(world.Truth().at(0)));
  params.fault.fault = simulation::FaultFromString(options.fault);
  params.fault.turn_share = options.fault_turn_share;
  if (options.circles > 0) {
    const std::vector<double> elevations_deg = params.orbit.elevations_deg;
    params.orbit.elevations_deg.clear();
    for (int i = 0; i < options.circles; ++i) params.orbit.elevations_deg.push_back(elevations_deg[i % elevations_deg.size()]);
  }
  if (options.quick) {
    params.orbit.elevations_deg = {35.0};
    params.rate_hz = 10.0;
    params.fault.start_s = 3.0;
  }
  params.fault.start_s = options.fault_start_s.value_or(params.fault.start_s);
  return params;
}

// One orbit around the world's first object.
class OrbitRun {
 public:
  OrbitRun(const LearnerOptions& options, const learning::LearnerParams& params, const simulation::WorldParams& world,
           std::optional<int> other)
      : options_(options),
        name_(world.objects.front().name),
        world_(world),
        params_(SequenceOf(options, world_)),
        sequence_(world_, params_, other),
        trial_(params, name_),
        folder_(options.save.empty() ? fs::path() : fs::path(options.save) / name_) {}

  void Run() {
    if (!folder_.empty()) fs::create_directories(folder_);
    const int count = options_.frames > 0 ? std::min(options_.frames, sequence_.size()) : sequence_.size();
    for (int i = 0; i < count; ++i) {
      simulation::OrbitFrame orbit = sequence_.Frame(i);
      const FrameTruth truth{orbit.T_camera_mesh, orbit.time_s, orbit.circle, orbit.faulty, orbit.usable};
      learning::Target target;
      if (orbit.T_camera_mesh && !trial_.learner().object()) target.pixel = MiddlePixel(*orbit.T_camera_mesh);
      const TrialStep& step = trial_.Step(orbit.frame, truth, target);
      if (!folder_.empty() && (i % kPictureEvery == 0 || step.wrong)) SavePicture(orbit, step);
    }
    trial_.Finish();
  }

  Json Result() {
    Json result;
    result["object"] = name_;
    result["start_azimuth_deg"] = params_.orbit.start_azimuth_deg;
    result["fault"] = options_.fault;
    result.update(FiguresOf(trial_));
    result["points"] = PointFigures(trial_, rendering::SurfaceDistance(world_.MeshOf(0)));
    result["circles"] = Json::array();
    for (int circle = 0; circle < sequence_.circles(); ++circle) {
      const double closes_s = sequence_.ClosesAt_s(circle);
      if (trial_.steps().back().truth.time_s < closes_s) break;
      const double opens_s = circle == 0 ? 0.0 : sequence_.ClosesAt_s(circle - 1);
      result["circles"].push_back(
          {{"worst_second", Second(WorstSecond(opens_s, closes_s))}, {"last_second", Second(closes_s - kSecond_s)}});
    }
    if (!folder_.empty()) {
      SaveTrial(trial_, name_ + ", fault: " + options_.fault, folder_);
      WriteWhole(folder_ / "figures.json", result.dump(2) + "\n");
    }
    return result;
  }

 private:
  // A second of a circle: as its frames were tracked, and as the model at the end places them.
  Json Second(double from_s) {
    std::vector<PoseError> before, after;
    int tried = 0;
    for (std::size_t i = 0; i < trial_.steps().size(); ++i) {
      const TrialStep& step = trial_.steps()[i];
      if (step.truth.time_s <= from_s || step.truth.time_s > from_s + kSecond_s) continue;
      if (step.error) before.push_back(*step.error);
      if (i % kReplacedEvery != 0 || !step.truth.usable) continue;
      ++tried;
      simulation::OrbitFrame orbit = sequence_.Frame(static_cast<int>(i));
      orbit.frame.T_world_camera.reset();
      if (const auto error = trial_.Replaced(orbit.frame, step.truth)) after.push_back(*error);
    }
    return {{"from_s", from_s},
            {"as_tracked", ErrorFigures(before)},
            {"by_final_model", ErrorFigures(after)},
            {"tried", tried},
            {"placed", after.size()}};
  }

  // When the second begins in which the track was worst (median over its frames): drift is largest before the circle closes.
  double WorstSecond(double from_s, double to_s) const {
    double worst = -1.0, worst_from_s = from_s;
    for (double second_s = from_s; second_s + kSecond_s <= to_s; second_s += kSecond_s / 2) {
      std::vector<double> sizes;  // 3 mm weigh as much as 0.5 degrees.
      for (const TrialStep& step : trial_.steps()) {
        if (step.error && step.truth.time_s > second_s && step.truth.time_s <= second_s + kSecond_s)
          sizes.push_back(step.error->translation_mm / 3.0 + step.error->rotation_deg / 0.5);
      }
      const double size = Quantile(sizes, 0.5);
      if (size > worst) {
        worst = size;
        worst_from_s = second_s;
      }
    }
    return worst_from_s;
  }

  std::optional<Eigen::Vector2d> MiddlePixel(const geometry::Rigid& T_camera_mesh) const {
    const Eigen::Matrix3Xd points = world_.Truth()[0].points;
    return world_.Camera().Project(T_camera_mesh * Eigen::Vector3d(points.rowwise().mean()));
  }

  // Colour and depth side by side.
  void SavePicture(const simulation::OrbitFrame& orbit, const TrialStep& step) const {
    cv::Mat depth, picture;
    if (orbit.frame.depth.empty()) {
      depth = cv::Mat::zeros(orbit.frame.color.size(), CV_8UC3);
    } else {
      orbit.frame.depth.convertTo(depth, CV_8U, 0.1);  // 2.55 m is white.
      cv::merge(std::vector<cv::Mat>{depth, depth, depth}, depth);
    }
    cv::hconcat(orbit.frame.color, depth, picture);
    std::ostringstream name;
    name << "frame_" << orbit.frame.id << (step.wrong ? "_wrong" : step.tracked ? "" : "_lost") << ".png";
    cv::imwrite((folder_ / name.str()).string(), picture);
  }

  LearnerOptions options_;
  std::string name_;
  simulation::SimulatedWorld world_;
  simulation::SequenceParams params_;
  simulation::OrbitSequence sequence_;
  LearnerTrial trial_;
  fs::path folder_;
};

// The world for one mesh; where it is swapped for another, that one is the last object.
simulation::WorldParams WorldFor(const simulation::WorldParams& base, const std::vector<fs::path>& meshes) {
  return meshes.empty() ? base : simulation::WorldWithMeshes(base, meshes);
}

void RunEvaluateLearner(const LearnerOptions& options) {
  CheckOutput(options.common);
  if (options.meshes.empty() && options.world.empty() && options.sequence.folder.empty()) {
    throw std::runtime_error("say what to learn: --mesh, --world FILE for its first object, or --sequence DIR");
  }
  cv::setNumThreads(1);
  const params::LibraryParams params = LoadParams(options.common);
  if (!options.sequence.folder.empty()) {
    const Json result = TrySequence(options.sequence, params.learner, options.save);
    const std::string witness = result.contains("witness") ? "  " + WitnessSummary(result["witness"]) : "";
    return WriteResult(options.common, result, SummaryOf(result) + witness);
  }
  const simulation::WorldParams base =
      options.world.empty() ? simulation::WorldParams() : simulation::LoadWorldParams(options.world);
  const bool swapped = options.fault == simulation::ToString(simulation::Fault::kSwapped);
  std::vector<std::vector<fs::path>> scenes;  // The meshes of every run.
  for (std::size_t i = 0; i < options.meshes.size(); ++i) {
    scenes.push_back({MeshFile(options.meshes[i])});
    if (swapped && !options.swapped_for.empty()) scenes.back().push_back(MeshFile(options.swapped_for));
  }
  if (scenes.empty()) scenes.emplace_back();
  Json result;
  result["seed"] = options.common.seed;
  result["objects"] = Json::array();
  std::string summary;
  for (const std::vector<fs::path>& meshes : scenes) {
    const simulation::WorldParams world = WorldFor(base, meshes);
    if (world.objects.empty()) throw std::runtime_error(options.world + ": has no objects; name one with --mesh");
    const std::optional<int> other =
        swapped && world.objects.size() > 1 ? std::optional(static_cast<int>(world.objects.size()) - 1) : std::nullopt;
    OrbitRun run(options, params.learner, world, other);
    run.Run();
    result["objects"].push_back(run.Result());
    const std::string text = SummaryOf(result["objects"].back());
    if (options.common.json != "-" && scenes.size() > 1) std::cerr << text << std::flush;
    summary += text;
  }
  WriteResult(options.common, result, summary);
}

}  // namespace

void AddEvaluateLearner(CLI::App& evaluate, Run& run) {
  auto options = std::make_shared<LearnerOptions>();
  CLI::App* verb = evaluate.add_subcommand(
      "learner",
      "The learner while a simulated camera circles an object: is it tracked, how far does it drift, are all views right");
  AddCommonOptions(*verb, options->common);
  verb->add_option(
          "--mesh", options->meshes,
          "What stands on the table: a mesh (OBJ or PLY), a folder with textured.obj, or its name in meshes/ of $VANTAGE_DATA; "
          "several, parted by commas, are taken in turn")
      ->delimiter(',')
      ->type_name("MESH[,...]");
  verb->add_option("--world", options->world, "The room, as config/worlds/table.yaml; without --mesh its first object is learned")
      ->type_name("FILE");
  verb->add_option("--fault", options->fault, "What goes wrong on the way")
      ->check(CLI::IsMember(simulation::FaultNames()))
      ->capture_default_str();
  verb->add_option("--fault-start", options->fault_start_s,
                   "When, seconds (default 4, with --quick 3); on a later circle every side is known when it is over")
      ->check(CLI::NonNegativeNumber)
      ->type_name("S");
  verb->add_option("--fault-speed", options->fault_turn_share, "The camera goes on at this share of its speed meanwhile")
      ->check(CLI::Range(0.01, 1.0))
      ->capture_default_str()
      ->type_name("SHARE");
  verb->add_option("--swapped-for", options->swapped_for, "With --fault swapped and --mesh: the mesh that takes the object's place")
      ->type_name("MESH");
  verb->add_option("--frames", options->frames, "Stop after so many frames (default: all circles)")
      ->check(CLI::Range(1, 1000000))
      ->type_name("N");
  verb->add_option("--circles", options->circles, "So many circles, by turns at each elevation: does time and memory stay flat?")
      ->check(CLI::Range(1, 100))
      ->type_name("N");
  SequenceTrialOptions& sequence = options->sequence;
  CLI::Option* folder =
      verb->add_option("--sequence", sequence.folder, "Learn from a recording (a BOP scene folder) instead")->type_name("DIR");
  verb->add_option("--object-id", sequence.object_id, "The object of scene_gt.json to learn")
      ->check(CLI::Range(1, 1000000))
      ->needs(folder)
      ->type_name("N");
  verb->add_option("--learn-frames", sequence.frames,
                   "With --sequence: learn from these: all, even, odd (by id), or ids A:B without B")
      ->needs(folder)
      ->capture_default_str();
  verb->add_option("--passes", sequence.passes, "With --sequence: go through them so often")
      ->check(CLI::Range(1, 100))
      ->needs(folder)
      ->capture_default_str();
  verb->add_option("--find-frames", sequence.find,
                   "With --sequence: then find the object in these by recognition, learning nothing")
      ->needs(folder);
  verb->add_flag("--no-query-depth", sequence.no_query_depth, "With --sequence: views are placed by their colour images only")
      ->needs(folder);
  verb->add_flag("--witness", sequence.witness,
                 "With --sequence: hold recorded and tracked poses against a bundle adjustment of all that the images show")
      ->needs(folder);
  verb->add_option("--start-azimuth", options->start_azimuth_deg,
                   "Where the camera begins, degrees about z from x (default: before the object's broadest side)")
      ->type_name("DEG");
  verb->add_flag("--quick", options->quick, "One circle at 10 Hz instead of two at 30")->excludes("--circles");
  verb->add_flag("--tell-poses", options->tell_poses, "The learner is told where the camera is");
  verb->add_option("--save", options->save, "Write frames.csv, views.csv, plot.png (where gnuplot is found) and pictures here")
      ->type_name("DIR");
  verb->callback([options, &run] { run = [options] { RunEvaluateLearner(*options); }; });
}

}  // namespace vantage::cli
