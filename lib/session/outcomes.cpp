#include "session/outcomes.h"

#include <algorithm>

#include "geometry/rigid.h"
#include "learning/learner.h"

namespace vantage::session {
namespace {

constexpr int kDirections = 120;  // Of the table, over the whole sphere: 18 degrees apart, which is what its cost allows.
constexpr std::uint32_t kLearnSeed = 0x0ac1e, kLookSeed = 0x5ee;  // Pictures of their own.

std::vector<geometry::Rigid> CandidatePoses(const simulation::World& world, const geometry::Rigid& T_world_object,
                                            exploration::CandidateParams params) {
  params.directions = std::min(params.directions, kDirections);
  std::vector<geometry::Rigid> poses = world.Viewpoints();
  if (!poses.empty()) return poses;
  for (const auto& candidate : exploration::SampleCandidates(T_world_object, params)) poses.push_back(candidate.T_world_camera);
  return poses;
}

}  // namespace

exploration::OutcomeTable MakeOutcomeTable(const simulation::World& world, const ExploreStart& start, const ExploreParams& params,
                                           const Judge& judge, double max_angle_rad,
                                           const std::function<void(int done, int all)>& progress) {
  geometry::Rigid T_world_object = geometry::Rigid::Identity();  // As a learner would place it: axes of the world.
  T_world_object.translation() = start.T_world_mesh * Eigen::Vector3d(judge.points_in_mesh().rowwise().mean());

  Judge looks(params.learner.recogniser, judge.points_in_mesh());
  std::vector<geometry::Rigid> T_world_cameras;
  exploration::OutcomeTable table;
  for (const geometry::Rigid& pose : CandidatePoses(world, T_world_object, params.candidates)) {
    rgbd::Frame frame = world.Look(pose, kLookSeed);
    if (!params.learner.recogniser.use_query_depth) frame.depth = cv::Mat();
    if (!looks.Add(frame, pose.inverse() * start.T_world_mesh)) continue;
    T_world_cameras.push_back(pose);
    table.viewpoints.push_back(exploration::ViewpointOf(pose, T_world_object));
  }
  const std::size_t count = table.viewpoints.size();
  for (std::size_t i = 0; i < count; ++i) {
    if (progress) progress(static_cast<int>(i), static_cast<int>(count));
    learning::Learner learner(params.learner, start.object_name);
    learning::Target target;
    target.pixel = world.Camera().Project(T_world_cameras[i].inverse() * T_world_object.translation());
    const bool learned = learner.Process(world.Look(T_world_cameras[i], kLearnSeed), target).view_added;
    std::vector<char> asked(count, 0);
    for (std::size_t j = 0; j < count; ++j) {
      const double angle = geometry::AngleBetween(table.viewpoints[i].direction, table.viewpoints[j].direction);
      asked[j] = static_cast<char>(learned && angle <= max_angle_rad);
    }
    const std::vector<char> row =
        learned ? looks.Outcomes(learner.object(), start.T_world_mesh.inverse() * *learner.T_world_object(), asked) : asked;
    table.detected.insert(table.detected.end(), row.begin(), row.end());
  }
  return table;
}

}  // namespace vantage::session
