#include "simulation/orbit_sequence.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

namespace vantage::simulation {
namespace {

constexpr double kDeg = M_PI / 180.0;
constexpr double kTurnAway_s = 0.4;  // To look away, and again to look back.
constexpr double kInView = 0.8;      // Share of the object's points in the image from which it can be found.
constexpr std::uint32_t kDropSeed = 0x64726f70;

const std::vector<std::pair<Fault, std::string>>& Names() {
  static const std::vector<std::pair<Fault, std::string>> names = {
      {Fault::kNone, "none"}, {Fault::kCovered, "covered"},  {Fault::kSwapped, "swapped"}, {Fault::kMoved, "moved"},
      {Fault::kBlur, "blur"}, {Fault::kNoDepth, "no_depth"}, {Fault::kDropped, "dropped"}};
  return names;
}

double DurationOf(const FaultParams& params) {
  if (params.duration_s > 0.0) return params.duration_s;
  switch (params.fault) {
    case Fault::kCovered:
    case Fault::kSwapped:
    case Fault::kMoved:
      return 2.0;
    case Fault::kBlur:
    case Fault::kNoDepth:
      return 1.0;
    default:
      return std::numeric_limits<double>::infinity();
  }
}

double SmoothStep(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

Eigen::Vector3d Middle(const TrueObject& object) {
  const Eigen::Matrix3Xd points = object.T_world_object * object.points;
  return 0.5 * (points.rowwise().minCoeff() + points.rowwise().maxCoeff());
}

std::uint32_t NumberSeed(std::uint32_t seed, std::uint32_t number) { return seed * 2654435761u + number; }

void Cover(std::uint32_t seed, rgbd::Frame* frame) {
  cv::RNG random(seed + 1);
  random.fill(frame->color, cv::RNG::NORMAL, 3.0, 2.0);
  frame->depth.setTo(0);
}

}  // namespace

std::string ToString(Fault fault) {
  for (const auto& [named, name] : Names()) {
    if (named == fault) return name;
  }
  return "";
}

Fault FaultFromString(const std::string& text) {
  std::string all;
  for (const auto& [fault, name] : Names()) {
    if (name == text) return fault;
    all += (all.empty() ? "" : ", ") + name;
  }
  throw std::invalid_argument("there is no fault '" + text + "'; there are " + all);
}

std::vector<std::string> FaultNames() {
  std::vector<std::string> names;
  for (const auto& [fault, name] : Names()) names.push_back(name);
  return names;
}

void FaultParams::Check() const {
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(std::string("fault: ") + what);
  };
  require(start_s >= 0.0, "start_s must be >= 0");
  require(duration_s >= 0.0, "duration_s must be >= 0");
  require(turn_share > 0.0 && turn_share <= 1.0, "turn_share must be in (0, 1]");
  require(dropped_share >= 0.0 && dropped_share < 1.0, "dropped_share must be in [0, 1)");
}

void SequenceParams::Check() const {
  orbit.Check();
  fault.Check();
  if (!(rate_hz > 0.0)) throw std::invalid_argument("sequence: rate_hz must be > 0");
}

OrbitSequence::OrbitSequence(SimulatedWorld& world, const SequenceParams& params, std::optional<int> other)
    : world_(world), params_(params), other_(other), object_(world.Truth().at(0)), path_(params.orbit, Middle(object_)) {
  params_.Check();
  if (other_) {
    const TrueObject other_object = world.Truth().at(*other_);
    Eigen::Vector3d there = Middle(object_) - Middle(other_object);
    there.z() = 0.0;  // It stands on the table already.
    world_.MoveObject(*other_, Eigen::Translation3d(there) * other_object.T_world_object);
    world_.ShowObject(*other_, false);
  }
  std::mt19937 random(params.seed ^ kDropSeed);
  const double held_up_s = ClosesAt_s(path_.circles() - 1) - path_.ClosesAt_s(path_.circles() - 1);
  const int count = static_cast<int>(std::floor((path_.duration_s() + held_up_s) * params.rate_hz)) + 1;
  for (int number = 0; number < count; ++number) {
    const bool dropped = static_cast<double>(random()) / 4294967296.0 < params.fault.dropped_share;
    if (params.fault.fault == Fault::kDropped && IsFaulty(number / params.rate_hz) && dropped) continue;
    numbers_.push_back(number);
  }
}

bool OrbitSequence::IsFaulty(double time_s) const {
  const FaultParams& fault = params_.fault;
  return fault.fault != Fault::kNone && time_s >= fault.start_s && time_s < fault.start_s + DurationOf(fault);
}

double OrbitSequence::PathTime_s(double time_s) const {
  const FaultParams& fault = params_.fault;
  const bool hides = fault.fault == Fault::kCovered || fault.fault == Fault::kSwapped || fault.fault == Fault::kBlur;
  if (!hides) return time_s;
  return time_s - (1.0 - fault.turn_share) * std::clamp(time_s - fault.start_s, 0.0, DurationOf(fault));
}

double OrbitSequence::ClosesAt_s(int circle) const {
  const FaultParams& fault = params_.fault;
  const double on_path_s = path_.ClosesAt_s(circle), into_fault_s = on_path_s - fault.start_s;
  if (into_fault_s <= 0.0 || PathTime_s(on_path_s) == on_path_s) return on_path_s;
  return fault.start_s + std::min(into_fault_s / fault.turn_share, into_fault_s + (1.0 - fault.turn_share) * DurationOf(fault));
}

geometry::Rigid OrbitSequence::CameraAt(double time_s) const {
  geometry::Rigid T_world_camera = path_.PoseAt(PathTime_s(time_s));
  if (params_.fault.fault != Fault::kMoved) return T_world_camera;
  const double since_s = time_s - params_.fault.start_s, left_s = DurationOf(params_.fault) - since_s;
  const double away = SmoothStep(since_s / kTurnAway_s) * SmoothStep(left_s / kTurnAway_s);
  T_world_camera.rotate(Eigen::AngleAxisd(away * params_.fault.look_away_deg * kDeg, Eigen::Vector3d::UnitY()));
  return T_world_camera;
}

geometry::Rigid OrbitSequence::ObjectAt(double time_s) const {
  const FaultParams& fault = params_.fault;
  if (fault.fault != Fault::kMoved || time_s < fault.start_s + DurationOf(fault) / 2) return object_.T_world_object;
  const Eigen::Vector3d middle = Middle(object_);
  geometry::Rigid T_world_world = geometry::Rigid::Identity();
  T_world_world.translate(middle + fault.moved_m * Eigen::Vector3d(std::cos(0.7), std::sin(0.7), 0.0));
  T_world_world.rotate(Eigen::AngleAxisd(fault.moved_deg * kDeg, Eigen::Vector3d::UnitZ()));
  T_world_world.translate(-middle);
  return T_world_world * object_.T_world_object;
}

Twist OrbitSequence::MotionAt(double time_s, std::uint32_t number) const {
  constexpr double kStep_s = 1e-3;
  Twist twist = TwistBetween(CameraAt(time_s), CameraAt(time_s + kStep_s), kStep_s);
  if (params_.fault.fault == Fault::kBlur && IsFaulty(time_s)) {
    std::mt19937 random(NumberSeed(params_.seed, number));
    const double angle = 2.0 * M_PI * static_cast<double>(random()) / 4294967296.0;
    twist.angular_rad_s += params_.fault.shake_rad_s * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0);
  }
  return twist;
}

bool OrbitSequence::IsInView(const geometry::Rigid& T_camera_mesh) const {
  const geometry::PinholeCamera camera = world_.Camera();
  int inside = 0;
  for (Eigen::Index i = 0; i < object_.points.cols(); ++i) {
    const auto pixel = camera.Project(T_camera_mesh * Eigen::Vector3d(object_.points.col(i)));
    inside += pixel && camera.Contains(*pixel);
  }
  return inside >= kInView * static_cast<double>(object_.points.cols());
}

OrbitFrame OrbitSequence::Frame(int index) {
  const int number = numbers_.at(index);
  const std::uint32_t seed = NumberSeed(params_.seed, static_cast<std::uint32_t>(number));
  OrbitFrame result;
  result.time_s = number / params_.rate_hz;
  result.T_world_camera = CameraAt(result.time_s);
  result.faulty = IsFaulty(result.time_s);
  while (result.circle + 1 < path_.circles() && result.time_s > ClosesAt_s(result.circle)) ++result.circle;

  const bool gone = params_.fault.fault == Fault::kSwapped && result.faulty;
  const geometry::Rigid T_world_mesh = ObjectAt(result.time_s);
  world_.MoveObject(0, T_world_mesh);
  world_.ShowObject(0, !gone);
  if (other_) world_.ShowObject(*other_, gone);
  if (!gone) result.T_camera_mesh = result.T_world_camera.inverse() * T_world_mesh;

  result.frame = world_.Look(result.T_world_camera, seed, MotionAt(result.time_s, static_cast<std::uint32_t>(number)));
  result.frame.id = number + 1;
  result.frame.utime = std::llround(number * 1e6 / params_.rate_hz);
  if (!params_.tell_camera_pose) result.frame.T_world_camera.reset();
  if (result.faulty && params_.fault.fault == Fault::kCovered) Cover(seed, &result.frame);
  if (result.faulty && params_.fault.fault == Fault::kNoDepth) result.frame.depth = cv::Mat();
  const bool spoilt = result.faulty && params_.fault.fault != Fault::kDropped;
  result.usable = !spoilt && result.T_camera_mesh && IsInView(*result.T_camera_mesh);
  return result;
}

}  // namespace vantage::simulation
