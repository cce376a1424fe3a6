// The arm as a mount: one lazy PRM (OMPL; Bohlin and Kavraki, 2000) in joint space for all goals of a decision. Roadmap edges are
// checked only where they lie on a shortest path, which for many goals from one start is a small part of them.
#include <ompl/base/ProblemDefinition.h>
#include <ompl/base/SpaceInformation.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/datastructures/NearestNeighborsLinear.h>
#include <ompl/geometric/planners/prm/LazyPRM.h>

#include <array>
#include <boost/graph/dijkstra_shortest_paths.hpp>
#include <boost/property_map/transform_value_property_map.hpp>
#include <map>
#include <mutex>
#include <random>
#include <thread>

#include "motion/arm_collision.h"
#include "motion/arm_ik.h"
#include "motion/joint_path.h"
#include "motion/ompl_support.h"

namespace vantage::motion {
namespace {

namespace ob = ompl::base;
namespace og = ompl::geometric;
using geometry::Rigid;
using Joints = Eigen::VectorXd;

constexpr char kInCollision[] = "in collision";
constexpr char kOutOfReach[] = "out of reach";
constexpr char kNoPath[] = "no path found";
constexpr unsigned kNeighbours = 10;
constexpr int kAttemptsPerSample = 20;
constexpr int kMaxRounds = 200;       // Of searching the roadmap; each takes at least one edge out of it.
constexpr double kSafeCut_m = 0.006;  // Rounding by less stays within what was checked (kSureClearance_m).
constexpr double kWideCut_m = 0.08;   // Rounding to be checked.
constexpr unsigned kShorteningSteps = 40;
constexpr double kShorteningSpacing_s = 0.4;

Joints ToJoints(const ob::State* state, Eigen::Index count) {
  return Eigen::Map<const Joints>(state->as<ob::RealVectorStateSpace::StateType>()->values, count);
}

void Assign(const Joints& joints, ob::State* state) {
  Eigen::Map<Joints>(state->as<ob::RealVectorStateSpace::StateType>()->values, joints.size()) = joints;
}

// Joint space; distance is the time a move takes at full speed.
class JointSpace : public ob::RealVectorStateSpace {
 public:
  explicit JointSpace(const ArmModel& arm) : RealVectorStateSpace(static_cast<unsigned>(arm.joints())), speeds_(arm.joints()) {
    ob::RealVectorBounds bounds(getDimension());
    for (Eigen::Index j = 0; j < arm.joints(); ++j) {
      const ArmLink& link = arm.links[static_cast<std::size_t>(j) + 1];
      bounds.setLow(static_cast<unsigned>(j), link.lower_rad);
      bounds.setHigh(static_cast<unsigned>(j), link.upper_rad);
      speeds_[j] = link.max_speed_rad_s;
    }
    setBounds(bounds);
  }

  double distance(const ob::State* a, const ob::State* b) const override {
    const double* from = a->as<StateType>()->values;
    const double* to = b->as<StateType>()->values;
    double longest_s = 0.0;
    for (Eigen::Index j = 0; j < speeds_.size(); ++j) longest_s = std::max(longest_s, std::abs(from[j] - to[j]) / speeds_[j]);
    return longest_s;
  }

 private:
  Joints speeds_;
};

// OMPL's lazy PRM, with milestones that are given to it and shortest paths from one of them to all others.
class LazyRoadmap : public og::LazyPRM {
 public:
  LazyRoadmap(const ob::SpaceInformationPtr& space, const ArmCollision& collision)
      : LazyPRM(space), collision_(collision), joints_(space->getStateDimension()) {
    nn_ = std::make_shared<ompl::NearestNeighborsLinear<Vertex>>();  // Exact and without a generator of its own.
    nn_->setDistanceFunction([this](Vertex a, Vertex b) { return distanceFunction(a, b); });
    setRange(1e3);  // No edge is cut short.
    setMaxNearestNeighbors(kNeighbours);
    setProblemDefinition(std::make_shared<ob::ProblemDefinition>(space));
    setup();
  }

  // A posture that is free.
  Vertex Add(const Joints& joints) {
    ob::State* state = si_->allocState();
    Assign(joints, state);
    const Vertex vertex = addMilestone(state);
    indexProperty_[vertex] = boost::num_vertices(g_) - 1;  // OMPL numbers them only when it searches itself.
    return vertex;
  }

  void Connect(Vertex a, Vertex b) {
    if (boost::edge(a, b, g_).second) return;
    boost::add_edge(a, b, Graph::edge_property_type(ob::Cost(distanceFunction(a, b)), VALIDITY_UNKNOWN), g_);
  }

  // The quickest free way to one of each goal's postures; empty where there is none.
  std::vector<std::vector<Joints>> FindPaths(Vertex start, const std::vector<std::vector<Vertex>>& goals) {
    std::vector<std::vector<Joints>> paths(goals.size());
    std::vector<char> done(goals.size(), 0);
    for (int round = 0; round < kMaxRounds; ++round) {
      Search(start);
      bool all_done = true;
      for (std::size_t i = 0; i < goals.size(); ++i) {
        if (done[i] != 0) continue;
        const Vertex* nearest = nullptr;
        for (const Vertex& vertex : goals[i]) {
          if (nearest == nullptr || DistanceTo(vertex) < DistanceTo(*nearest)) nearest = &vertex;
        }
        done[i] = static_cast<char>(nearest == nullptr || !std::isfinite(DistanceTo(*nearest)));
        if (done[i] == 0 && IsWayFree(start, *nearest)) {
          paths[i] = WayTo(start, *nearest);
          done[i] = 1;
        }
        all_done = all_done && done[i] != 0;
      }
      if (all_done) break;
    }
    return paths;
  }

 private:
  std::size_t IndexOf(Vertex vertex) const { return boost::get(boost::vertex_index, g_, vertex); }
  double DistanceTo(Vertex vertex) const { return distances_[IndexOf(vertex)]; }

  void Search(Vertex start) {
    const std::size_t count = boost::num_vertices(g_);
    previous_.assign(count, start);
    distances_.assign(count, 0.0);
    const auto index = boost::get(boost::vertex_index, g_);
    const auto weights = boost::make_transform_value_property_map([](const ob::Cost& cost) { return cost.value(); },
                                                                  boost::get(boost::edge_weight, g_));
    boost::dijkstra_shortest_paths(g_, start,
                                   boost::predecessor_map(boost::make_iterator_property_map(previous_.begin(), index))
                                       .distance_map(boost::make_iterator_property_map(distances_.begin(), index))
                                       .weight_map(weights)
                                       .distance_inf(std::numeric_limits<double>::infinity())
                                       .vertex_index_map(index));
  }

  // Checks the edges to here that were not checked yet; one that is not free leaves the roadmap.
  bool IsWayFree(Vertex start, Vertex goal) {
    for (Vertex v = goal; v != start; v = previous_[IndexOf(v)]) {
      const Vertex before = previous_[IndexOf(v)];
      const auto [edge, exists] = boost::edge(before, v, g_);
      if (!exists) return false;  // Taken out for another goal in this round.
      if (edgeValidityProperty_[edge] == VALIDITY_TRUE) continue;
      if (!collision_.IsMoveFree(ToJoints(stateProperty_[before], joints_), ToJoints(stateProperty_[v], joints_))) {
        boost::remove_edge(edge, g_);
        return false;
      }
      edgeValidityProperty_[edge] = VALIDITY_TRUE;
    }
    return true;
  }

  std::vector<Joints> WayTo(Vertex start, Vertex goal) const {
    std::vector<Joints> way;
    for (Vertex v = goal;; v = previous_[IndexOf(v)]) {
      way.push_back(ToJoints(stateProperty_[v], joints_));
      if (v == start) break;
    }
    std::reverse(way.begin(), way.end());
    return way;
  }

  const ArmCollision& collision_;
  Eigen::Index joints_;
  std::vector<Vertex> previous_;
  std::vector<double> distances_;
};

class ArmMount : public Mount {
 public:
  ArmMount(std::shared_ptr<const ArmModel> arm, const Obstacles& obstacles)
      : arm_(std::move(arm)), ik_(arm_), collision_(arm_, obstacles) {
    const Eigen::Index count = arm_->joints();
    limits_ = {Joints(count), Joints::Constant(count, arm_->params.max_acceleration_rad_s2), Joints(count)};
    for (Eigen::Index j = 0; j < count; ++j) {
      limits_.max_speed_rad_s[j] = arm_->links[static_cast<std::size_t>(j) + 1].max_speed_rad_s;
      limits_.reach_m[j] = arm_->reach_m.row(j).maxCoeff();
    }
    auto space = std::make_shared<JointSpace>(*arm_);
    space_ = std::make_shared<ob::SpaceInformation>(space);
    space_->setStateValidityChecker([this, count](const ob::State* state) { return collision_.IsFree(ToJoints(state, count)); });
    space_->setMotionValidator(std::make_shared<MoveValidator>(space_, [this, count](const ob::State* from, const ob::State* to) {
      return collision_.IsMoveFree(ToJoints(from, count), ToJoints(to, count));
    }));
    space_->setup();
  }

  std::string WhyUnreachable(const Rigid& T_world_camera) const override { return PosturesFor(T_world_camera).refusal; }

  std::optional<Stance> StanceAt(const Rigid& T_world_camera) const override {
    const Postures postures = PosturesFor(T_world_camera);
    if (postures.free.empty()) return std::nullopt;
    return Stance(arm_->CameraPose(postures.free.front()), postures.free.front());
  }

  std::vector<PathResult> Plan(const Stance& start, const std::vector<Rigid>& T_world_camera_goals,
                               std::uint32_t seed) const override;
  Trajectory Shortened(const Trajectory& path, std::uint32_t seed) const override;

 private:
  // Joints that put the camera somewhere, touching nothing; or why there are none.
  struct Postures {
    std::vector<Joints> free;
    std::string refusal;
  };
  Postures PosturesFor(const Rigid& T_world_camera) const;
  void PreparePostures(const std::vector<Rigid>& T_world_cameras) const;
  std::string WhyNoStart(const Joints& start) const;
  Trajectory ToTrajectory(const std::vector<TimedJoints>& timed) const;
  bool IsFree(const Trajectory& path) const;

  std::shared_ptr<const ArmModel> arm_;
  ArmIk ik_;
  ArmCollision collision_;
  JointLimits limits_;
  ob::SpaceInformationPtr space_;

  // What was found out about poses; the same ones are asked about again and again.
  using Key = std::array<double, 6>;
  static Key KeyOf(const Rigid& pose) {
    const Eigen::Vector3d place = pose.translation(), axis = pose.linear().col(2);
    return {place.x(), place.y(), place.z(), axis.x(), axis.y(), axis.z()};
  }
  mutable std::mutex mutex_;
  mutable std::map<Key, Postures> known_;
};

ArmMount::Postures ArmMount::PosturesFor(const Rigid& T_world_camera) const {
  if (!T_world_camera.matrix().allFinite()) return {{}, kOutOfReach};
  const Key key = KeyOf(T_world_camera);
  {
    const std::lock_guard lock(mutex_);
    const auto found = known_.find(key);
    if (found != known_.end()) return found->second;
  }
  Postures postures;
  const std::vector<Joints> solutions = ik_.Solve(T_world_camera);
  for (const Joints& joints : solutions) {
    if (static_cast<int>(postures.free.size()) >= arm_->params.ik_solutions) break;
    if (collision_.IsFree(joints)) postures.free.push_back(joints);
  }
  if (solutions.empty()) {
    postures.refusal = kOutOfReach;
  } else if (postures.free.empty()) {
    postures.refusal = kInCollision;
  }
  const std::lock_guard lock(mutex_);
  return known_.emplace(key, std::move(postures)).first->second;
}

// Finds postures for all poses on two threads; which thread does which makes no difference.
void ArmMount::PreparePostures(const std::vector<Rigid>& T_world_cameras) const {
  const auto work = [&](std::size_t first) {
    for (std::size_t i = first; i < T_world_cameras.size(); i += 2) PosturesFor(T_world_cameras[i]);
  };
  std::thread other(work, 1);
  work(0);
  other.join();
}

std::string ArmMount::WhyNoStart(const Joints& start) const {
  if (!arm_->IsWithinLimits(start)) return std::string("start ") + kOutOfReach;
  return collision_.IsFree(start) ? "" : std::string("start ") + kInCollision;
}

Trajectory ArmMount::ToTrajectory(const std::vector<TimedJoints>& timed) const {
  Trajectory trajectory;
  for (const TimedJoints& entry : timed) {
    trajectory.waypoints.push_back({entry.time_s, arm_->CameraPose(entry.joints_rad), entry.joints_rad});
  }
  return trajectory;
}

bool ArmMount::IsFree(const Trajectory& path) const {
  for (std::size_t i = 1; i < path.waypoints.size(); ++i) {
    if (!collision_.IsMoveFree(path.waypoints[i - 1].joints_rad, path.waypoints[i].joints_rad)) return false;
  }
  return true;
}

std::vector<PathResult> ArmMount::Plan(const Stance& start, const std::vector<Rigid>& T_world_camera_goals,
                                       std::uint32_t seed) const {
  std::vector<PathResult> results(T_world_camera_goals.size());
  Joints from = start.joints_rad;
  if (from.size() == 0) {
    const auto stance = StanceAt(start.T_world_camera);
    if (stance) from = stance->joints_rad;
  }
  const std::string start_refusal = WhyNoStart(from);
  PreparePostures(T_world_camera_goals);

  LazyRoadmap roadmap(space_, collision_);
  std::mt19937 random(seed);
  for (int draw = 0, added = 0; start_refusal.empty() && draw < arm_->params.roadmap_samples * kAttemptsPerSample; ++draw) {
    if (added == arm_->params.roadmap_samples) break;
    const Joints& joints = arm_->postures[random() % arm_->postures.size()].joints_rad;
    if (!collision_.IsFree(joints)) continue;
    roadmap.Add(joints);
    ++added;
  }
  std::vector<std::vector<LazyRoadmap::Vertex>> goals(results.size());
  for (std::size_t i = 0; i < results.size(); ++i) {
    Postures postures = PosturesFor(T_world_camera_goals[i]);
    results[i].refusal = postures.refusal;
    if (results[i].refusal.empty()) results[i].refusal = start_refusal;
    if (!results[i].refusal.empty()) continue;
    const auto near = ik_.SolveFrom(T_world_camera_goals[i], from);
    if (near && collision_.IsFree(*near)) postures.free.push_back(*near);
    for (const Joints& joints : postures.free) goals[i].push_back(roadmap.Add(joints));
  }
  if (!start_refusal.empty()) return results;
  const LazyRoadmap::Vertex origin = roadmap.Add(from);
  for (const auto& vertices : goals) {
    for (const auto& vertex : vertices) roadmap.Connect(origin, vertex);
  }
  const auto paths = roadmap.FindPaths(origin, goals);
  for (std::size_t i = 0; i < results.size(); ++i) {
    if (!results[i].refusal.empty()) continue;
    if (paths[i].empty()) {
      results[i].refusal = kNoPath;
    } else {
      results[i].trajectory = ToTrajectory(TimeJointPath(paths[i], limits_, kSafeCut_m));
    }
  }
  return results;
}

Trajectory ArmMount::Shortened(const Trajectory& path, std::uint32_t seed) const {
  og::PathGeometric states(space_);
  ob::ScopedState<> state(space_);
  const int pieces = std::max(1, static_cast<int>(std::ceil(path.duration_s() / kShorteningSpacing_s)));
  for (int i = 0; i <= pieces; ++i) {
    Assign(path.Sample(path.duration_s() * i / pieces).joints_rad, state.get());
    states.append(state.get());
  }
  CutShort(seed, kShorteningSteps, states);
  std::vector<Joints> corners;
  for (const ob::State* vertex : states.getStates()) corners.push_back(ToJoints(vertex, arm_->joints()));
  for (const double cut_m : {kWideCut_m, kSafeCut_m}) {
    Trajectory shorter = ToTrajectory(TimeJointPath(corners, limits_, cut_m));
    if (shorter.duration_s() < path.duration_s() && IsFree(shorter)) return shorter;
  }
  return path;
}

}  // namespace

std::unique_ptr<Mount> MakeArmMount(std::shared_ptr<const ArmModel> arm, const Obstacles& obstacles) {
  return std::make_unique<ArmMount>(std::move(arm), obstacles);
}

geometry::Rigid CameraOnMount(const Eigen::Vector3d& position_m, const Eigen::Vector3d& rotation_rad) {
  geometry::Rigid T_mount_camera = geometry::Rigid::Identity();
  T_mount_camera.linear() = Eigen::AngleAxisd(rotation_rad.norm(), rotation_rad.normalized()).toRotationMatrix();
  T_mount_camera.translation() = position_m;
  return T_mount_camera;
}

void ArmMountParams::Check() const {
  const auto require = [](bool good, const char* field, const char* wanted) {
    if (!good) throw std::invalid_argument(std::string(field) + " must be " + wanted);
  };
  require(base_position_m.allFinite(), "base_position_m", "finite");
  require(std::isfinite(base_yaw_rad), "base_yaw_rad", "finite");
  require(std::isfinite(base_roll_rad), "base_roll_rad", "finite");
  require(camera_position_m.allFinite(), "camera_position_m", "finite");
  require(camera_rotation_rad.allFinite(), "camera_rotation_rad", "finite");
  require(clearance_m > kSureClearance_m, "clearance_m", "> 0.008");
  require(max_acceleration_rad_s2 > 0.0, "max_acceleration_rad_s2", "> 0");
  require(ik_seeds >= 1, "ik_seeds", ">= 1");
  require(ik_solutions >= 1, "ik_solutions", ">= 1");
  require(roadmap_samples >= 0, "roadmap_samples", ">= 0");
}

void MountParams::Check() const {
  if (type != "free" && type != "arm") throw std::invalid_argument("type must be free or arm, is \"" + type + "\"");
  free.Check();
  arm.Check();
  if (type == "arm" && arm.urdf.empty()) throw std::invalid_argument("arm.urdf must name the arm's URDF file, is empty");
}

MountMaker::MountMaker(const MountParams& params) : params_(params) {
  params_.Check();
  if (params_.type == "arm") arm_ = LoadArm(params_.arm);
}

std::unique_ptr<Mount> MountMaker::Make(const Obstacles& obstacles) const {
  return arm_ ? MakeArmMount(arm_, obstacles) : MakeFreeMount(params_.free, obstacles);
}

std::string MountMaker::WhyNotDriven(const Trajectory& path, const Eigen::VectorXd& joints_rad, double max_start_rad,
                                     double tolerance) const {
  if (!arm_) return "";
  for (std::size_t i = 0; i < path.waypoints.size(); ++i) {
    const Waypoint& waypoint = path.waypoints[i];
    const auto at = [&](Eigen::Index joint) {
      return "joint " + std::to_string(joint + 1) + " at " + std::to_string(waypoint.time_s) + " s ";
    };
    if (waypoint.joints_rad.size() != arm_->joints()) {
      return "needs " + std::to_string(arm_->joints()) + " joints, has " + std::to_string(waypoint.joints_rad.size());
    }
    for (Eigen::Index j = 0; j < arm_->joints(); ++j) {
      const ArmLink& link = arm_->links[static_cast<std::size_t>(j) + 1];
      if (waypoint.joints_rad[j] < link.lower_rad - 1e-6 || waypoint.joints_rad[j] > link.upper_rad + 1e-6) {
        return at(j) + "is out of its range";
      }
      if (i == 0) {
        if (!(std::abs(waypoint.joints_rad[j] - joints_rad[j]) <= max_start_rad)) return at(j) + "is not where the arm is";
        continue;
      }
      const Waypoint& before = path.waypoints[i - 1];
      const double speed = std::abs(waypoint.joints_rad[j] - before.joints_rad[j]) / (waypoint.time_s - before.time_s);
      if (speed > link.max_speed_rad_s * (1.0 + tolerance)) return at(j) + "turns at " + std::to_string(speed) + " rad/s";
    }
  }
  return "";
}

BodyAt MountMaker::Body() const { return arm_ ? ArmBody(arm_) : CameraBall(params_.free.camera_radius_m); }

}  // namespace vantage::motion
