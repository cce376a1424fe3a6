// What a camera circling an object sees, frame by frame, with faults injected and the truth kept aside.
#pragma once

#include <optional>
#include <string>

#include "simulation/orbit.h"
#include "simulation/simulated_world.h"

namespace vantage::simulation {

enum class Fault {
  kNone,
  kCovered,  // A hand before the camera: nearly black, no depth.
  kSwapped,  // Another object stands in the object's place.
  kMoved,    // The camera looks away; meanwhile the object is put elsewhere on the table.
  kBlur,     // The camera is shaken.
  kNoDepth,  // The depth stream stops.
  kDropped,  // Every other frame, by chance, is missing.
};
std::string ToString(Fault fault);
// Throws std::invalid_argument naming those there are.
Fault FaultFromString(const std::string& text);
std::vector<std::string> FaultNames();

struct FaultParams {
  Fault fault = Fault::kNone;
  double start_s = 4.0;     // >= 0.
  double duration_s = 0.0;  // 0: covered and swapped 2 s, moved 2 s, blur and no_depth 1 s, dropped to the end; >= 0.
  double moved_m = 0.15;    // By how much the object is moved...
  double moved_deg = 60.0;  // ...and turned.
  double look_away_deg = 75.0;
  double shake_rad_s = 4.0;  // At 525 px and 15 ms: 30 px of blur.
  double dropped_share = 0.5;
  double turn_share = 0.25;  // While covered, swapped or shaken the camera goes on at this share of its speed: the side that shows
                             // afterwards should be one that was seen; (0, 1].

  void Check() const;  // Throws std::invalid_argument naming the field.
};

struct SequenceParams {
  OrbitParams orbit;
  FaultParams fault;
  double rate_hz = 30.0;
  bool tell_camera_pose = false;  // Frames know their T_world_camera.
  std::uint32_t seed = 0;         // Of the sensor's noise, the shake and the dropped frames.

  void Check() const;
};

struct OrbitFrame {
  rgbd::Frame frame;                             // id counts from 1 (missing frames count), utime in steps of 1 / rate.
  geometry::Rigid T_world_camera;                // Truth, as is all that follows.
  std::optional<geometry::Rigid> T_camera_mesh;  // nullopt where the object is not there.
  double time_s = 0.0;
  int circle = 0;
  bool faulty = false;  // The fault is at work (where frames are dropped: some were).
  bool usable = false;  // The object can be found in it: it is there, well inside the image, and no fault spoils the picture.
};

// Frames are rendered as they are asked for.
class OrbitSequence {
 public:
  // Circles the object with index 0 of `world`, which must outlive this. `other`: the object that takes its place (kSwapped):
  // hidden but then; nullopt = the object just disappears. Throws as SequenceParams::Check.
  OrbitSequence(SimulatedWorld& world, const SequenceParams& params, std::optional<int> other = std::nullopt);

  int size() const { return static_cast<int>(numbers_.size()); }
  // Deterministic in (params, index), in whatever order frames are asked for. Moves the world's objects.
  OrbitFrame Frame(int index);
  int circles() const { return path_.circles(); }
  // As OrbitPath::ClosesAt_s, on this sequence's clock.
  double ClosesAt_s(int circle) const;

 private:
  double PathTime_s(double time_s) const;  // Where on its path the camera is.
  bool IsFaulty(double time_s) const;
  geometry::Rigid CameraAt(double time_s) const;
  geometry::Rigid ObjectAt(double time_s) const;
  Twist MotionAt(double time_s, std::uint32_t number) const;
  bool IsInView(const geometry::Rigid& T_camera_mesh) const;

  SimulatedWorld& world_;
  SequenceParams params_;
  std::optional<int> other_;
  TrueObject object_;  // As it stands at first.
  OrbitPath path_;
  std::vector<int> numbers_;  // Those that are not missing.
};

}  // namespace vantage::simulation
