// The learner on a sequence of frames, held against the truth frame by frame.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "learning/learner.h"
#include "rendering/surface_distance.h"
#include "vantage/verb.h"

namespace vantage::cli {

// A pose or a view is wrong where it is off by more than one of these.
constexpr double kWrongTranslation_mm = 20.0;
constexpr double kWrongRotation_deg = 5.0;

struct FrameTruth {
  std::optional<geometry::Rigid> T_camera_mesh;  // nullopt: the object is not there.
  double time_s = 0.0;
  int circle = 0;
  bool faulty = false;
  bool usable = true;  // The object can be found in this frame.
};

struct PoseError {
  double translation_mm = 0.0;
  double rotation_deg = 0.0;
  bool wrong() const { return translation_mm > kWrongTranslation_mm || rotation_deg > kWrongRotation_deg; }
};

struct TrialStep {
  std::int64_t frame_id = 0;
  FrameTruth truth;
  bool tracked = false;
  std::optional<PoseError> error;  // Where it was tracked and the object is there.
  bool wrong = false;              // Tracked, but wrong or not there.
  learning::LearnerResult result;
  int views = 0;
  int wrong_views = 0;  // Of these, as the model has them now.
  int points = 0;
  double ms = 0.0;         // Wall clock of Learner::Process.
  double cpu_ms = 0.0;     // Processor time of the calling thread.
  double memory_mb = 0.0;  // Resident, of the whole program.
};

struct ViewError {
  int id = 0;
  std::int64_t frame_id = 0;
  std::optional<PoseError> error;  // nullopt: the object was not in that frame.
  bool wrong() const { return !error || error->wrong(); }
};

// The object's own frame is tied to the mesh's by the first view and the truth there.
class LearnerTrial {
 public:
  LearnerTrial(const learning::LearnerParams& params, const std::string& name);

  const TrialStep& Step(const rgbd::Frame& frame, const FrameTruth& truth, const learning::Target& target = {},
                        const std::optional<geometry::Rigid>& known_pose = std::nullopt);

  // Lets what the learner does beside tracking come to its end; before what follows is asked.
  void Finish() { learner_.FinishRefinement(); }

  const learning::Learner& learner() const { return learner_; }
  const std::vector<TrialStep>& steps() const { return steps_; }
  const std::optional<geometry::Rigid>& T_mesh_object() const { return T_mesh_object_; }

  std::optional<PoseError> ErrorOf(const geometry::Rigid& T_camera_object, const FrameTruth& truth) const;
  // Of every view in the model as it is now.
  std::vector<ViewError> ViewErrors() const;
  // Where the model as it is now, not told where to look, finds the object in a frame; nullopt = not found.
  std::optional<PoseError> Replaced(const rgbd::Frame& frame, const FrameTruth& truth) const;

 private:
  learning::LearnerParams params_;
  std::string name_;
  learning::Learner learner_;
  std::optional<geometry::Rigid> T_mesh_object_;
  std::map<std::int64_t, FrameTruth> truth_;  // By frame id.
  std::vector<TrialStep> steps_;
};

// The figures of a trial as JSON: frames, tracking, views, times, memory, and where there was a fault how it was got over.
Json FiguresOf(const LearnerTrial& trial);
// Distances of the model's points to the mesh's surface, millimetres.
Json PointFigures(const LearnerTrial& trial, const rendering::SurfaceDistance& surface);
// {"median": .., "max": ..} and the like, of millimetres and degrees.
Json ErrorFigures(const std::vector<PoseError>& errors);

// The figures for people.
std::string SummaryOf(const Json& figures);

// DIR/frames.csv, DIR/views.csv and, where the program gnuplot is found, DIR/plot.png. Throws std::runtime_error where DIR cannot
// be written.
void SaveTrial(const LearnerTrial& trial, const std::string& title, const std::filesystem::path& folder);

}  // namespace vantage::cli
