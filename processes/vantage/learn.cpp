// vantage learn: an object from a recording into a store.
#include <CLI/CLI.hpp>
#include <chrono>
#include <optional>
#include <sstream>

#include "learning/learner.h"
#include "model/store.h"
#include "vantage/sequence.h"
#include "vantage/verb.h"

namespace vantage::cli {
namespace {

struct LearnOptions {
  CommonOptions common;
  std::string sequence;
  std::string store;
  std::string object;
  std::string frames = "all";
  int object_id = 0;                 // 0 = not given.
  std::vector<double> object_pixel;  // Empty = not given.
  bool use_known_poses = false;
};

// What the run came to.
struct Tally {
  int frames = 0;
  int tracked = 0;
  int lost = 0;  // Frames after the first view in which the object was not found.
  std::vector<double> ms;
  std::vector<double> translation_error_mm;
  std::vector<double> rotation_error_deg;
  std::string note;  // Why the last frame brought nothing.
};

// The store file is made with the first view: a run that learns nothing leaves nothing.
class ViewKeeper {
 public:
  explicit ViewKeeper(const std::filesystem::path& file) : file_(file) {
    if (std::filesystem::exists(file)) {
      store_.emplace(file, model::Store::Mode::kWrite);
    } else {
      CheckWritable(file);
    }
  }

  // The model as it is now, durably; with its first view it replaces what the store knew under that name.
  void Keep(const model::ObjectModel& object) {
    if (!store_) store_.emplace(file_, model::Store::Mode::kWrite);
    const int newest = static_cast<int>(object.views.size()) - 1;
    if (newest == 0) {
      store_->SaveObject(object);
    } else {
      store_->Update(object);
    }
  }

 private:
  std::filesystem::path file_;
  std::optional<model::Store> store_;
};

// Where the first view was taken, and how the object lay in it.
struct Reference {
  KnownPose known;
  geometry::Rigid T_camera_object;
};

// How far the camera's motion since the first view, as tracked, is from the recording's.
void JudgeMotion(const geometry::Rigid& T_camera_object, const Reference& reference, const geometry::Rigid& T_camera_reference,
                 Tally& tally) {
  const geometry::Rigid T_reference_camera = reference.T_camera_object * T_camera_object.inverse();
  const geometry::PoseDifference error = geometry::Difference(T_reference_camera, T_camera_reference.inverse());
  tally.translation_error_mm.push_back(1000.0 * error.translation_m);
  tally.rotation_error_deg.push_back(error.rotation_rad * 180.0 / M_PI);
}

class LearnRun {
 public:
  explicit LearnRun(const LearnOptions& options)
      : options_(options),
        params_(LoadParams(options.common)),
        scene_(options.sequence),
        ids_(FramesOf(scene_, options.frames)),
        name_(options.object.empty() ? NameOfFolder(options.sequence) : options.object),
        keeper_(options.store),
        learner_(params_.learner, name_) {
    if (options.object_id > 0) object_id_ = options.object_id;
    if (object_id_) label_ = LabelOfObject(scene_, *object_id_);
  }

  void Run() {
    for (const int id : ids_) Step(id);
    if (!learner_.object()) {
      throw std::runtime_error(options_.sequence + ": no object was found in " + std::to_string(ids_.size()) + " frames (" +
                               tally_.note + "); say which one with --object-pixel U,V or take other --frames");
    }
    if (learner_.FinishRefinement()) keeper_.Keep(*learner_.object());
  }

  Json Result() const {
    const model::ObjectModel& object = *learner_.object();
    Json result;
    result["object"] = name_;
    result["store"] = options_.store;
    result["frames"] = tally_.frames;
    result["tracked"] = tally_.tracked;
    result["views"] = object.views.size();
    result["points"] = object.points.size();
    result["ms_per_frame_median"] = Number(Quantile(tally_.ms, 0.5));
    result["ms_per_frame_p95"] = Number(Quantile(tally_.ms, 0.95));
    result["lost"] = tally_.lost;
    result["translation_error_mm_median"] = Number(Quantile(tally_.translation_error_mm, 0.5));
    result["rotation_error_deg_median"] = Number(Quantile(tally_.rotation_error_deg, 0.5));
    return result;
  }

  std::string Summary() const {
    const model::ObjectModel& object = *learner_.object();
    std::ostringstream text;
    text.precision(3);
    text << "learned '" << name_ << "' into " << options_.store << ": " << object.views.size() << " views, " << object.points.size()
         << " points; tracked in " << tally_.tracked << " of " << tally_.frames << " frames, " << Quantile(tally_.ms, 0.5)
         << " ms a frame\n";
    if (!tally_.translation_error_mm.empty()) {
      text << "camera motion: median error " << Quantile(tally_.translation_error_mm, 0.5) << " mm, "
           << Quantile(tally_.rotation_error_deg, 0.5) << " degrees\n";
    }
    return text.str();
  }

 private:
  void Step(int id) {
    rgbd::Frame frame = scene_.Load(id);
    ++tally_.frames;
    const std::optional<learning::Target> target = TargetIn(id);
    if (!target) {
      tally_.note = "object " + std::to_string(*object_id_) + " is not in the image";
      return;
    }
    const KnownPose known = KnownPoseOf(scene_, frame, object_id_);
    const auto T_camera_reference = reference_ ? MotionBetween(reference_->known, known) : std::nullopt;
    std::optional<geometry::Rigid> known_pose;
    if (options_.use_known_poses) {
      if (!known.known() || (reference_ && !T_camera_reference)) {
        throw std::runtime_error(options_.sequence + ": frame " + std::to_string(id) +
                                 " has no known pose; run without --use-known-poses");
      }
      if (reference_) known_pose = *T_camera_reference * reference_->T_camera_object;
    }
    // The recording's poses judge the track; they must not help it.
    if (!options_.use_known_poses) frame.T_world_camera.reset();

    const auto start = std::chrono::steady_clock::now();
    const learning::LearnerResult step = learner_.Process(frame, *target, known_pose);
    tally_.ms.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
    tally_.note = step.note;

    const bool tracked = step.state == learning::State::kTracking && step.T_camera_object;
    if (tracked) ++tally_.tracked;
    if (reference_ && !tracked) ++tally_.lost;
    if (step.view_added || step.refined) keeper_.Keep(*learner_.object());
    if (tracked && T_camera_reference && !options_.use_known_poses) {
      JudgeMotion(*step.T_camera_object, *reference_, *T_camera_reference, tally_);
    }
    if (!reference_ && tracked) reference_ = Reference{known, *step.T_camera_object};
  }

  // Where to begin in this frame; nullopt where the object asked for is not in it.
  std::optional<learning::Target> TargetIn(int id) const {
    learning::Target target;
    if (learner_.object()) return target;
    if (!options_.object_pixel.empty()) target.pixel = Eigen::Vector2d(options_.object_pixel[0], options_.object_pixel[1]);
    if (object_id_) {
      target.pixel = PixelOfObject(scene_, id, *object_id_, label_);
      if (!target.pixel) return std::nullopt;
    }
    return target;
  }

  LearnOptions options_;
  params::LibraryParams params_;
  rgbd::BopScene scene_;
  std::vector<int> ids_;
  std::string name_;
  std::optional<int> object_id_;
  std::optional<int> label_;
  ViewKeeper keeper_;
  learning::Learner learner_;
  std::optional<Reference> reference_;
  Tally tally_;
};

}  // namespace

void AddLearn(CLI::App& app, Run& run) {
  auto options = std::make_shared<LearnOptions>();
  CLI::App* verb =
      app.add_subcommand("learn", "Learn an object from a recording (a BOP scene folder); every view is stored as it is learned");
  AddCommonOptions(*verb, options->common);
  verb->add_option("--sequence", options->sequence, "Folder with rgb/, depth/ and scene_camera.json")->required()->type_name("DIR");
  verb->add_option("--store", options->store, "The model store; made where there is none")->required()->type_name("FILE");
  verb->add_option("--object", options->object,
                   "Name to learn it under (default: the folder's name); what the store has under it is replaced")
      ->type_name("NAME");
  CLI::Option* id = verb->add_option("--object-id", options->object_id, "Learn this object of scene_gt.json")
                        ->check(CLI::Range(1, 1000000))
                        ->type_name("N");
  verb->add_option("--object-pixel", options->object_pixel,
                   "Learn the object at this pixel of the first frame (default: the one nearest to the centre)")
      ->delimiter(',')
      ->expected(2)
      ->excludes(id)
      ->type_name("U,V");
  verb->add_option("--frames", options->frames, "Which frames: all, even, odd (by id), or ids A:B without B")
      ->capture_default_str();
  verb->add_flag("--use-known-poses", options->use_known_poses, "Place views by the recording's own poses instead of tracking");
  verb->callback([options, &run] {
    run = [options] {
      CheckOutput(options->common);
      LearnRun learn(*options);
      learn.Run();
      WriteResult(options->common, learn.Result(), learn.Summary());
    };
  });
}

}  // namespace vantage::cli
