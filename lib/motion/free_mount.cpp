#include <ompl/base/ProblemDefinition.h>
#include <ompl/base/SpaceInformation.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/datastructures/NearestNeighborsLinear.h>
#include <ompl/geometric/planners/prm/PRM.h>

#include <boost/graph/dijkstra_shortest_paths.hpp>
#include <boost/property_map/transform_value_property_map.hpp>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "motion/mount.h"
#include "motion/ompl_support.h"

namespace vantage::motion {
namespace {

namespace ob = ompl::base;
namespace og = ompl::geometric;
using geometry::Rigid;
using Position = Eigen::Vector3d;

constexpr char kInCollision[] = "in collision";
constexpr char kOutside[] = "out of the workspace";
constexpr char kNoPath[] = "no path found";
constexpr unsigned kNeighbours = 15;     // Connections tried per milestone.
constexpr double kSampleMargin_m = 0.4;  // Half of the milestones lie this near to the box around start and goals.
constexpr int kAttemptsPerSample = 20;   // At most so many draws per milestone wanted, where much is blocked.
constexpr unsigned kShorteningSteps = 60;
constexpr double kLeastClearance_m = 1e-3;

Position ToPosition(const ob::State* state) {
  const double* values = state->as<ob::RealVectorStateSpace::StateType>()->values;
  return {values[0], values[1], values[2]};
}

void Assign(const Position& position, ob::State* state) {
  for (unsigned i = 0; i < 3; ++i) state->as<ob::RealVectorStateSpace::StateType>()->values[i] = position[i];
}

// OMPL's generators are seeded from a process-wide sequence; this uses its own, so that equal seeds give equal paths.
class SeededSampler : public ob::RealVectorStateSampler {
 public:
  SeededSampler(const ob::StateSpace* space, std::uint32_t seed) : RealVectorStateSampler(space) { rng_.setLocalSeed(seed); }

  Position Uniform(const Position& lower, const Position& upper) {
    Position position;
    for (int i = 0; i < 3; ++i) position[i] = rng_.uniformReal(lower[i], upper[i]);
    return position;
  }
};

// OMPL's PRM, with milestones that are given to it and shortest paths from one of them to all others.
class Roadmap : public og::PRM {
 public:
  explicit Roadmap(const ob::SpaceInformationPtr& space) : PRM(space) {
    nn_ = std::make_shared<ompl::NearestNeighborsLinear<Vertex>>();  // Exact and without a generator of its own.
    nn_->setDistanceFunction([this](Vertex a, Vertex b) { return distanceFunction(a, b); });
    setMaxNearestNeighbors(kNeighbours);
    setProblemDefinition(std::make_shared<ob::ProblemDefinition>(space));
    setup();
  }

  Vertex Add(const Position& position) {
    ob::State* state = si_->allocState();
    Assign(position, state);
    return addMilestone(state);
  }

  void FindPathsFrom(Vertex start) {
    start_ = start;
    previous_.resize(boost::num_vertices(g_));
    std::vector<double> distances(previous_.size());
    const auto weights = boost::make_transform_value_property_map([](const ob::Cost& cost) { return cost.value(); },
                                                                  boost::get(boost::edge_weight, g_));
    boost::dijkstra_shortest_paths(g_, start,
                                   boost::predecessor_map(previous_.data()).distance_map(distances.data()).weight_map(weights));
  }

  // Positions from start to goal; empty where they are not connected.
  std::vector<Position> PathTo(Vertex goal) const {
    if (previous_[goal] == goal && goal != start_) return {};
    std::vector<Position> path;
    for (Vertex v = goal;; v = previous_[v]) {
      path.push_back(ToPosition(stateProperty_[v]));
      if (v == start_) break;
    }
    std::reverse(path.begin(), path.end());
    return path;
  }

 private:
  Vertex start_ = 0;
  std::vector<Vertex> previous_;
};

// Poses along positions, turning evenly (by arc length) from the first orientation to the last.
std::vector<Rigid> WithOrientations(const std::vector<Position>& positions, const Rigid& start, const Rigid& goal) {
  double length_m = 0.0;
  for (std::size_t i = 1; i < positions.size(); ++i) length_m += (positions[i] - positions[i - 1]).norm();
  std::vector<Rigid> poses{start};
  double gone_m = 0.0;
  for (std::size_t i = 1; i + 1 < positions.size(); ++i) {
    gone_m += (positions[i] - positions[i - 1]).norm();
    Rigid pose = geometry::Interpolate(start, goal, gone_m / length_m);
    pose.translation() = positions[i];
    poses.push_back(pose);
  }
  poses.push_back(goal);
  return poses;
}

class FreeMount : public Mount {
 public:
  FreeMount(const FreeMountParams& params, const Obstacles& obstacles)
      : params_(params), obstacles_(obstacles), world_(obstacles, params.camera_radius_m + params.clearance_m) {}

  std::string WhyUnreachable(const Rigid& T_world_camera) const override {
    const Position position = T_world_camera.translation();
    const bool inside = (position.array() >= params_.workspace_lower_m.array()).all() &&
                        (position.array() <= params_.workspace_upper_m.array()).all();
    if (!inside || !T_world_camera.matrix().allFinite()) return kOutside;
    return world_.IsFree(position) ? "" : kInCollision;
  }

  std::vector<PathResult> Plan(const Stance& start, const std::vector<Rigid>& T_world_camera_goals,
                               std::uint32_t seed) const override;

 private:
  ob::SpaceInformationPtr MakeSpace() const;
  void Grow(Roadmap& roadmap, const ob::SpaceInformationPtr& space, const std::vector<Position>& ends, std::uint32_t seed) const;
  std::vector<Position> Shortened(const ob::SpaceInformationPtr& space, const std::vector<Position>& path,
                                  std::uint32_t seed) const;
  Trajectory Time(const std::vector<Rigid>& poses) const;

  FreeMountParams params_;
  Obstacles obstacles_;
  CollisionWorld world_;
};

ob::SpaceInformationPtr FreeMount::MakeSpace() const {
  auto space = std::make_shared<ob::RealVectorStateSpace>(3);
  ob::RealVectorBounds bounds(3);
  for (unsigned i = 0; i < 3; ++i) {
    bounds.setLow(i, params_.workspace_lower_m[i]);
    bounds.setHigh(i, params_.workspace_upper_m[i]);
  }
  space->setBounds(bounds);
  auto information = std::make_shared<ob::SpaceInformation>(space);
  information->setStateValidityChecker([this](const ob::State* state) { return world_.IsFree(ToPosition(state)); });
  information->setMotionValidator(std::make_shared<MoveValidator>(information, [this](const ob::State* from, const ob::State* to) {
    return world_.IsMoveFree(ToPosition(from), ToPosition(to));
  }));
  information->setup();
  return information;
}

// Free milestones, in turn from the whole workspace and from the surroundings of `ends`, where most paths run.
void FreeMount::Grow(Roadmap& roadmap, const ob::SpaceInformationPtr& space, const std::vector<Position>& ends,
                     std::uint32_t seed) const {
  Position lower = ends.front(), upper = ends.front();
  for (const Position& end : ends) {
    lower = lower.cwiseMin(end);
    upper = upper.cwiseMax(end);
  }
  lower = (lower.array() - kSampleMargin_m).max(params_.workspace_lower_m.array());
  upper = (upper.array() + kSampleMargin_m).min(params_.workspace_upper_m.array());
  SeededSampler sampler(space->getStateSpace().get(), seed);
  int milestones = 0;
  for (int draw = 0; draw < params_.roadmap_samples * kAttemptsPerSample && milestones < params_.roadmap_samples; ++draw) {
    const Position position =
        draw % 2 == 0 ? sampler.Uniform(lower, upper) : sampler.Uniform(params_.workspace_lower_m, params_.workspace_upper_m);
    if (!world_.IsFree(position)) continue;
    roadmap.Add(position);
    ++milestones;
  }
}

std::vector<Position> FreeMount::Shortened(const ob::SpaceInformationPtr& space, const std::vector<Position>& path,
                                           std::uint32_t seed) const {
  og::PathGeometric states(space);
  ob::ScopedState<> state(space);
  for (const Position& position : path) {
    Assign(position, state.get());
    states.append(state.get());
  }
  CutShort(seed, kShorteningSteps, states);
  std::vector<Position> shortened;
  for (const ob::State* vertex : states.getStates()) shortened.push_back(ToPosition(vertex));
  return shortened;
}

Trajectory FreeMount::Time(const std::vector<Rigid>& poses) const {
  Trajectory trajectory = TimePath(poses, params_.limits);
  if (poses.size() <= 2) return trajectory;
  for (std::size_t i = 1; i < trajectory.waypoints.size(); ++i) {
    const Position& from = trajectory.waypoints[i - 1].T_world_mount.translation();
    if (!world_.IsMoveFree(from, trajectory.waypoints[i].T_world_mount.translation())) {
      return TimePath(poses, params_.limits, 0.0);  // A rounded corner would touch: keep to what was checked.
    }
  }
  return trajectory;
}

std::vector<PathResult> FreeMount::Plan(const Stance& stance, const std::vector<Rigid>& T_world_camera_goals,
                                        std::uint32_t seed) const {
  const Rigid& T_world_camera_start = stance.T_world_camera;
  std::vector<PathResult> results(T_world_camera_goals.size());
  const std::string start_refusal = WhyUnreachable(T_world_camera_start);
  if (start_refusal == kInCollision) {
    const double left_m = world_.Clearance(T_world_camera_start.translation()) + params_.clearance_m;
    if (left_m > kLeastClearance_m) {  // An obstacle was seen to be larger than was known on the way here.
      FreeMountParams closer = params_;
      closer.clearance_m = left_m - kLeastClearance_m;
      return FreeMount(closer, obstacles_).Plan(stance, T_world_camera_goals, seed);
    }
  }
  const ob::SpaceInformationPtr space = MakeSpace();
  const Position start = T_world_camera_start.translation();
  ob::ScopedState<> from(space), to(space);
  Assign(start, from.get());
  std::vector<std::size_t> indirect;  // Goals without a free straight line.
  for (std::size_t i = 0; i < results.size(); ++i) {
    const Rigid& goal = T_world_camera_goals[i];
    results[i].refusal = WhyUnreachable(goal);
    if (results[i].refusal.empty() && !start_refusal.empty()) results[i].refusal = "start " + start_refusal;
    if (!results[i].refusal.empty()) continue;
    Assign(goal.translation(), to.get());
    if (space->checkMotion(from.get(), to.get())) {
      results[i].trajectory = Time({T_world_camera_start, goal});
    } else {
      indirect.push_back(i);
    }
  }
  if (indirect.empty()) return results;

  std::vector<Position> ends{start};
  for (const std::size_t i : indirect) ends.push_back(T_world_camera_goals[i].translation());
  Roadmap roadmap(space);
  Grow(roadmap, space, ends, seed);
  std::vector<Roadmap::Vertex> vertices;
  for (const Position& end : ends) vertices.push_back(roadmap.Add(end));
  roadmap.FindPathsFrom(vertices.front());
  for (std::size_t k = 0; k < indirect.size(); ++k) {
    const Rigid& goal = T_world_camera_goals[indirect[k]];
    const std::vector<Position> path = roadmap.PathTo(vertices[k + 1]);
    if (path.empty()) {
      results[indirect[k]].refusal = kNoPath;
      continue;
    }
    const auto path_seed = static_cast<std::uint32_t>(seed + 0x9E3779B9u * (k + 1));
    results[indirect[k]].trajectory = Time(WithOrientations(Shortened(space, path, path_seed), T_world_camera_start, goal));
  }
  return results;
}

}  // namespace

void FreeMountParams::Check() const {
  if (!(camera_radius_m > 0.0)) throw std::invalid_argument("camera_radius_m must be > 0, is " + std::to_string(camera_radius_m));
  if (!(clearance_m >= 0.0)) throw std::invalid_argument("clearance_m must be >= 0, is " + std::to_string(clearance_m));
  for (int i = 0; i < 3; ++i) {
    if (!(workspace_lower_m[i] < workspace_upper_m[i])) {
      throw std::invalid_argument("workspace_lower_m must be < workspace_upper_m along every axis, axis " + std::to_string(i) +
                                  " has " + std::to_string(workspace_lower_m[i]) + " and " + std::to_string(workspace_upper_m[i]));
    }
  }
  if (roadmap_samples < 0) throw std::invalid_argument("roadmap_samples must be >= 0, is " + std::to_string(roadmap_samples));
  limits.Check();
}

std::unique_ptr<Mount> MakeFreeMount(const FreeMountParams& params, const Obstacles& obstacles) {
  params.Check();
  return std::make_unique<FreeMount>(params, obstacles);
}

}  // namespace vantage::motion
