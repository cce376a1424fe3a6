#include "vantage/scenario.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <stdexcept>

#include "rendering/mesh.h"
#include "vantage/sequence.h"

namespace vantage::cli {
namespace {

namespace fs = std::filesystem;

constexpr int kSurfacePoints = 1000;
constexpr double kVoxel = 0.005;           // Metres between surface points read off depth images.
constexpr double kMinShareAtStart = 0.98;  // Of the object in the image.
constexpr int kBorderPx = 20;
constexpr int kStarts = 8;
constexpr std::uint32_t kJudgeSeed = 0x5eed;  // Judging views are others than any a run takes.

// --- Recordings ---

std::array<int, 3> VoxelOf(const Eigen::Vector3d& point) {
  const Eigen::Vector3d cell = (point / kVoxel).array().floor();
  return {static_cast<int>(cell.x()), static_cast<int>(cell.y()), static_cast<int>(cell.z())};
}

// The object's surface in mesh coordinates from labelled depth at the true poses, thinned to one point a voxel.
Eigen::Matrix3Xd SurfaceFromLabels(const rgbd::BopScene& scene, const std::vector<int>& ids, int object_id, int label) {
  std::map<std::array<int, 3>, Eigen::Vector3d> voxels;
  for (const int id : ids) {
    const auto T_camera_mesh = TruthOf(scene, id, object_id);
    if (!T_camera_mesh) continue;
    const rgbd::Frame frame = scene.Load(id);
    const cv::Mat labels = scene.LoadLabel(id);
    if (frame.depth.empty() || labels.size() != frame.depth.size()) continue;
    const geometry::Rigid T_mesh_camera = T_camera_mesh->inverse();
    for (int y = 0; y < labels.rows; y += 3) {
      for (int x = 0; x < labels.cols; x += 3) {
        const int depth_mm = frame.depth.at<std::uint16_t>(y, x);
        if (labels.at<uchar>(y, x) != label || depth_mm == 0) continue;
        const Eigen::Vector3d point = T_mesh_camera * frame.camera.Unproject({x, y}, 0.001 * depth_mm);
        voxels.emplace(VoxelOf(point), point);
      }
    }
  }
  Eigen::Matrix3Xd points(3, static_cast<Eigen::Index>(voxels.size()));
  Eigen::Index column = 0;
  for (const auto& [voxel, point] : voxels) points.col(column++) = point;
  return points;
}

Eigen::Matrix3Xd SurfaceOfRecorded(const rgbd::BopScene& scene, const std::vector<int>& ids, int object_id,
                                   std::optional<int> label, const std::string& mesh_file) {
  if (!mesh_file.empty()) return rendering::SampleSurface(rendering::LoadMesh(mesh_file), kSurfacePoints, 0);
  Eigen::Matrix3Xd points;
  if (label) points = SurfaceFromLabels(scene, ids, object_id, *label);
  if (points.cols() < 50) {
    throw std::runtime_error(scene.folder().string() + ": has no labelled depth of object " + std::to_string(object_id) +
                             " to judge by; give its mesh with --mesh");
  }
  return points;
}

bool ShowsAll(const Eigen::Matrix3Xd& points, const geometry::Rigid& T_camera_mesh, const geometry::PinholeCamera& camera) {
  int inside = 0;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const auto pixel = camera.Project(T_camera_mesh * Eigen::Vector3d(points.col(i)));
    inside += pixel && camera.Contains(*pixel, kBorderPx);
  }
  return inside >= kMinShareAtStart * static_cast<double>(points.cols());
}

// --- Simulated worlds ---

// A name for a mesh file: scans are often ".../003_cracker_box/textured.obj".
std::string NameOfMesh(const fs::path& file) {
  const std::string stem = file.stem().string();
  const bool generic = stem.rfind("textured", 0) == 0 || stem == "mesh" || stem == "model";
  return generic && file.has_parent_path() ? NameOfFolder(file.parent_path().string()) : stem;
}

// The first mesh in the middle of the table, the others around it.
simulation::WorldParams WorldOfMeshes(const std::vector<std::string>& mesh_files) {
  simulation::WorldParams params;
  for (std::size_t i = 0; i < mesh_files.size(); ++i) {
    simulation::ObjectParams object;
    object.name = NameOfMesh(mesh_files[i]);
    const auto same = std::count_if(params.objects.begin(), params.objects.end(),
                                    [&](const simulation::ObjectParams& other) { return other.name == object.name; });
    if (same > 0) object.name += "-" + std::to_string(i);
    object.mesh = fs::absolute(mesh_files[i]).string();
    if (i > 0) {
      const double angle = 2.0 * M_PI * static_cast<double>(i - 1) / static_cast<double>(mesh_files.size() - 1);
      object.position_m = Eigen::Vector3d(0.32 * std::cos(angle), 0.26 * std::sin(angle), 0.0);
    }
    params.objects.push_back(std::move(object));
  }
  return params;
}

struct Placed {
  simulation::TrueObject truth;
  Eigen::Vector3d centre_in_world;
};

Placed FindObject(const simulation::World& world, const std::string& name, const std::string& where) {
  for (const simulation::TrueObject& object : world.Truth()) {
    if (!name.empty() && object.name != name) continue;
    const Eigen::Vector3d middle = 0.5 * (object.points.rowwise().minCoeff() + object.points.rowwise().maxCoeff());
    return {object, object.T_world_object * middle};
  }
  throw std::runtime_error(where + (name.empty() ? ": has no objects" : ": has no object '" + name + "'"));
}

motion::Obstacles EverythingIn(const simulation::World& world) {
  motion::Obstacles obstacles = world.Furniture();
  for (const simulation::TrueObject& object : world.Truth()) {
    motion::HullObstacle hull;
    hull.name = object.name;
    for (Eigen::Index i = 0; i < object.points.cols(); ++i) {
      hull.points_in_world.push_back(object.T_world_object * Eigen::Vector3d(object.points.col(i)));
    }
    if (hull.points_in_world.size() >= 4) obstacles.hulls.push_back(std::move(hull));
  }
  return obstacles;
}

double Uniform(std::mt19937& random, double lower, double upper) {
  return lower + (upper - lower) * (static_cast<double>(random()) / 4294967296.0);
}

// A camera pose drawn evenly from the part of the view sphere that candidates come from.
geometry::Rigid RandomLook(std::mt19937& random, const Eigen::Vector3d& centre, const exploration::CandidateParams& params) {
  const double azimuth = Uniform(random, -M_PI, M_PI);
  const double z = Uniform(random, std::sin(params.min_elevation_rad), std::sin(params.max_elevation_rad));
  const double across = std::sqrt(1.0 - z * z);
  const double distance_m = params.distances_m[random() % params.distances_m.size()];
  const Eigen::Vector3d direction(across * std::cos(azimuth), across * std::sin(azimuth), z);
  return geometry::LookAt(centre + distance_m * direction, centre, Eigen::Vector3d::UnitZ());
}

}  // namespace

Scenario RecordedScenario(const std::string& folder, int object_id, const std::string& mesh_file,
                          const params::LibraryParams& params) {
  const auto scene = std::make_shared<const rgbd::BopScene>(folder);
  const std::optional<int> label = LabelOfObject(*scene, object_id);
  const std::vector<int> visitable = FramesOf(*scene, "even");
  const auto world = std::make_shared<const simulation::RecordedWorld>(scene, visitable);
  const Eigen::Matrix3Xd surface = SurfaceOfRecorded(*scene, visitable, object_id, label, mesh_file);

  Scenario scenario;
  scenario.world = world;
  scenario.judge_over_time = true;
  scenario.recogniser = params.recogniser;
  scenario.recogniser.use_query_depth = false;
  scenario.judge = std::make_unique<session::Judge>(scenario.recogniser, surface);
  for (const int id : FramesOf(*scene, "odd")) {
    const auto T_camera_mesh = TruthOf(*scene, id, object_id);
    if (!T_camera_mesh) continue;
    rgbd::Frame frame = scene->Load(id);
    frame.depth = cv::Mat();
    scenario.judge->Add(frame, *T_camera_mesh);
  }
  const std::vector<geometry::Rigid> viewpoints = world->Viewpoints();
  for (std::size_t i = 0; i < visitable.size(); ++i) {
    const auto T_camera_mesh = TruthOf(*scene, visitable[i], object_id);
    if (!T_camera_mesh || !ShowsAll(surface, *T_camera_mesh, world->Camera())) continue;
    session::ExploreStart start;
    start.target.pixel = PixelOfObject(*scene, visitable[i], object_id, label);
    if (!start.target.pixel) continue;
    start.T_world_camera = viewpoints[i];
    start.T_world_mesh = viewpoints[i] * *T_camera_mesh;
    start.object_name = "object " + std::to_string(object_id);
    scenario.starts.push_back(start);
  }
  if (scenario.starts.empty()) {
    throw std::runtime_error(folder + ": no even frame shows all of object " + std::to_string(object_id) + " to begin from");
  }
  return scenario;
}

Scenario SimulatedScenario(const std::string& world_file, const std::vector<std::string>& mesh_files, const std::string& object,
                           int judge_views, const params::LibraryParams& params, std::uint32_t seed, bool several_starts) {
  const simulation::WorldParams world_params =
      world_file.empty() ? WorldOfMeshes(mesh_files) : simulation::LoadWorldParams(world_file);
  const auto world = std::make_shared<const simulation::SimulatedWorld>(world_params);
  const Placed placed = FindObject(*world, object, world_file.empty() ? "--mesh" : world_file);

  Scenario scenario;
  scenario.world = world;
  scenario.recogniser = params.recogniser;
  scenario.judge = std::make_unique<session::Judge>(scenario.recogniser, placed.truth.points);
  const auto mount = motion::MountMaker(params.mount).Make(EverythingIn(*world));
  std::mt19937 random(seed ^ kJudgeSeed);
  for (int tries = 0; tries < 20 * judge_views && scenario.judge->size() < judge_views; ++tries) {
    const geometry::Rigid T_world_camera = RandomLook(random, placed.centre_in_world, params.candidates);
    if (!mount->WhyUnreachable(T_world_camera).empty()) continue;
    scenario.judge->Add(world->Look(T_world_camera, static_cast<std::uint32_t>(random())),
                        T_world_camera.inverse() * placed.truth.T_world_object);
  }
  if (scenario.judge->size() == 0) {
    throw std::runtime_error((world_file.empty() ? std::string("--mesh") : world_file) + ": no pose around '" + placed.truth.name +
                             "' can be reached; check mount and candidates in --config");
  }
  const int starts = several_starts ? kStarts : 1;
  for (int i = 0; i < starts; ++i) {
    const Eigen::AngleAxisd turn(2.0 * M_PI * i / starts, Eigen::Vector3d::UnitZ());
    session::ExploreStart start;
    start.T_world_camera =
        Eigen::Translation3d(placed.centre_in_world) * turn * Eigen::Translation3d(-placed.centre_in_world) * world->StartPose();
    start.target.pixel = world->Camera().Project(start.T_world_camera.inverse() * placed.centre_in_world);
    start.object_name = placed.truth.name;
    start.T_world_mesh = placed.truth.T_world_object;
    if (i == 0 || mount->WhyUnreachable(start.T_world_camera).empty()) scenario.starts.push_back(start);
  }
  return scenario;
}

}  // namespace vantage::cli
