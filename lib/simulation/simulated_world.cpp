#include "simulation/simulated_world.h"

#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "simulation/depth_sensor.h"

namespace vantage::simulation {
namespace {

namespace fs = std::filesystem;
using geometry::Rigid;
using rendering::Mesh;

constexpr double kSlab_m = 0.04;    // Thickness of the table top.
constexpr double kWall_m = 0.05;    // Of walls as obstacles.
constexpr int kTruthPoints = 1000;  // Surface points of every true object.
constexpr double kLargestObject_m = 2.0;

cv::Mat FindTexture(const std::string& name, const WorldParams& params) {
  std::string where;
  std::vector<std::string> folders = params.texture_folders;
  if (fs::path(name).is_absolute()) folders = {""};
  for (const std::string& folder : folders) {
    const fs::path file = fs::path(folder) / name;
    where += (where.empty() ? "" : ", ") + (folder.empty() ? std::string("/") : folder);
    if (!fs::is_regular_file(file)) continue;
    const cv::Mat image = cv::imread(file.string(), cv::IMREAD_COLOR);
    if (image.empty()) throw std::runtime_error(file.string() + ": not an image");
    return image;
  }
  throw std::runtime_error("no texture " + name + " in " + where +
                           "; the photographs come with Debian's package opencv-doc (apt-get install opencv-doc), others are found "
                           "where texture_folders says");
}

// The middle of an image, of the proportions of the face that wears it, so that the picture is not distorted.
cv::Mat MiddleOf(const cv::Mat& image, double width_m, double height_m) {
  const double aspect = width_m / height_m;
  int width = image.cols, height = image.rows;
  if (width > aspect * height) {
    width = std::max(1, static_cast<int>(aspect * height));
  } else {
    height = std::max(1, static_cast<int>(width / aspect));
  }
  return image(cv::Rect((image.cols - width) / 2, (image.rows - height) / 2, width, height));
}

// Smooth noise that repeats seamlessly: `size` x `size`, mean 0, deviation 1, features of about `grain_x` x `grain_y` pixels.
cv::Mat SmoothNoise(int size, int grain_x, int grain_y, cv::RNG* random) {
  constexpr int kMargin = 3;
  cv::Mat coarse(size / grain_y, size / grain_x, CV_32FC1), wrapped, fine;
  random->fill(coarse, cv::RNG::NORMAL, 0.0, 1.0);
  cv::copyMakeBorder(coarse, wrapped, kMargin, kMargin, kMargin, kMargin, cv::BORDER_WRAP);
  cv::resize(wrapped, fine, {}, grain_x, grain_y, cv::INTER_CUBIC);
  fine = fine(cv::Rect(kMargin * grain_x, kMargin * grain_y, size, size));
  cv::Scalar mean, deviation;
  cv::meanStdDev(fine, mean, deviation);
  return (fine - mean[0]) / deviation[0];
}

// Plain things are not perfectly plain: a colour with a faint grain, drawn out along x by `stretch` (wood has streaks).
cv::Mat PlainTexture(const cv::Scalar& color, int stretch, std::uint32_t seed) {
  constexpr int kSize = 512;
  cv::RNG random(seed);
  cv::Mat grain = cv::Mat::zeros(kSize, kSize, CV_32FC1);
  for (const int size : {2, 8, 32}) grain += 6.0 * SmoothNoise(kSize, std::min(size * stretch, kSize / 4), size, &random);
  cv::Mat plain;
  cv::merge(std::vector<cv::Mat>{grain + color[0], grain + color[1], grain + color[2]}, plain);
  plain.convertTo(plain, CV_8U);
  return plain;
}

Mesh LoadObject(const ObjectParams& object, const WorldParams& params) {
  if (object.mesh.empty()) {
    std::vector<cv::Mat> faces;
    for (int i = 0; i < 6; ++i) {
      const Eigen::Vector3d& size = object.box_m;
      const double width_m = i / 2 == 0 ? size.y() : size.x(), height_m = i / 2 == 2 ? size.y() : size.z();
      faces.push_back(MiddleOf(FindTexture(object.faces[i % object.faces.size()], params), width_m, height_m));
    }
    return rendering::BoxMesh(object.box_m, faces);
  }
  Mesh mesh = rendering::LoadMesh(object.mesh);
  Eigen::Vector3d lower, upper;
  rendering::Bounds(mesh, &lower, &upper);
  if ((upper - lower).maxCoeff() > kLargestObject_m)
    throw std::runtime_error(object.mesh + ": the mesh is " + std::to_string((upper - lower).maxCoeff()) +
                             " m large; vertices must be in metres");
  return mesh;
}

// The pose at which the middle of the mesh's bounds stands on `position_m`.
Rigid StandingPose(const Mesh& mesh, const Eigen::Vector3d& position_m, double yaw_deg) {
  Eigen::Vector3d lower, upper;
  rendering::Bounds(mesh, &lower, &upper);
  Rigid T = Rigid::Identity();
  T.translate(position_m);
  T.rotate(Eigen::AngleAxisd(yaw_deg * M_PI / 180.0, Eigen::Vector3d::UnitZ()));
  T.translate(-Eigen::Vector3d((lower.x() + upper.x()) / 2, (lower.y() + upper.y()) / 2, lower.z()));
  return T;
}

Rigid At(const Eigen::Vector3d& position) {
  Rigid T = Rigid::Identity();
  T.translation() = position;
  return T;
}

// The pose of an upright rectangle (x right, y up, z towards the viewer) at `position`, facing along `normal`.
Rigid Upright(const Eigen::Vector3d& position, const Eigen::Vector3d& normal) {
  Rigid T = At(position);
  T.linear().col(0) = Eigen::Vector3d::UnitZ().cross(normal);
  T.linear().col(1) = Eigen::Vector3d::UnitZ();
  T.linear().col(2) = normal;
  return T;
}

const std::vector<std::pair<std::string, Eigen::Vector3d>>& Walls() {  // Name and inward normal.
  static const std::vector<std::pair<std::string, Eigen::Vector3d>> walls = {
      {"wall +x", {-1, 0, 0}}, {"wall -x", {1, 0, 0}}, {"wall +y", {0, -1, 0}}, {"wall -y", {0, 1, 0}}};
  return walls;
}

geometry::PinholeCamera CameraOf(const SensorParams& sensor) {
  return {sensor.width,
          sensor.height,
          sensor.focal_length_px,
          sensor.focal_length_px,
          (sensor.width - 1) / 2.0,
          (sensor.height - 1) / 2.0};
}

}  // namespace

struct SimulatedWorld::Impl {
  WorldParams params;
  rendering::Scene scene;  // The objects first, in their order, then the furniture.
  std::vector<TrueObject> truth;
  std::vector<std::shared_ptr<const Mesh>> meshes;  // Of the objects.
  NoiseTable noise;

  void Add(Mesh mesh, const Rigid& T_world_mesh) { scene.Add(std::make_shared<const Mesh>(std::move(mesh)), T_world_mesh); }
  void AddObject(const ObjectParams& object);
  void AddTable();
  void AddRoom();
  rendering::Image Render(const Rigid& T_world_camera, const rendering::RenderParams& how) const;
};

void SimulatedWorld::Impl::AddObject(const ObjectParams& object) {
  Mesh mesh = LoadObject(object, params);
  TrueObject true_object;
  true_object.name = object.name;
  true_object.T_world_object = StandingPose(mesh, object.position_m, object.yaw_deg);
  true_object.points = rendering::SampleSurface(mesh, kTruthPoints, 1);
  truth.push_back(true_object);
  meshes.push_back(std::make_shared<const Mesh>(std::move(mesh)));
  scene.Add(meshes.back(), true_object.T_world_object);
}

void SimulatedWorld::Impl::AddTable() {
  const cv::Mat wood = PlainTexture({95, 130, 165}, 16, 1);
  const cv::Mat top = params.table_texture.empty() ? wood : FindTexture(params.table_texture, params);
  Add(rendering::RectangleMesh(params.table_size_x_m, params.table_size_y_m, top, params.table_tile_m), Rigid::Identity());
  Add(rendering::BoxMesh({params.table_size_x_m, params.table_size_y_m, kSlab_m}, {wood}), At({0, 0, -kSlab_m / 2 - 0.0005}));
  const double leg_m = params.table_height_m - kSlab_m;
  Add(rendering::BoxMesh({0.2, 0.2, leg_m}, {PlainTexture({60, 60, 60}, 1, 2)}), At({0, 0, -kSlab_m - leg_m / 2}));
}

void SimulatedWorld::Impl::AddRoom() {
  const cv::Mat paper =
      params.wall_texture.empty() ? PlainTexture({200, 210, 215}, 1, 3) : FindTexture(params.wall_texture, params);
  const double size = params.room_size_m, height = params.room_height_m, floor = -params.table_height_m;
  for (const auto& [name, normal] : Walls()) {
    Add(rendering::RectangleMesh(size, height, paper, params.wall_tile_m),
        Upright(Eigen::Vector3d(0, 0, floor + height / 2) - size / 2 * normal, normal));
  }
  Add(rendering::RectangleMesh(size, size, PlainTexture({110, 115, 120}, 1, 4), 1.0), At({0, 0, floor}));
  Add(rendering::RectangleMesh(size, size, PlainTexture({225, 225, 225}, 1, 5), 1.0), At({0, 0, floor + height}));
}

rendering::Image SimulatedWorld::Impl::Render(const Rigid& T_world_camera, const rendering::RenderParams& how) const {
  return scene.Render(CameraOf(params.sensor), T_world_camera, how);
}

SimulatedWorld::SimulatedWorld(const WorldParams& params) : impl_(std::make_unique<Impl>()) {
  params.Check();
  impl_->params = params;
  for (const ObjectParams& object : params.objects) impl_->AddObject(object);
  impl_->AddTable();
  impl_->AddRoom();
}

SimulatedWorld::~SimulatedWorld() = default;

rgbd::Frame SimulatedWorld::Look(const Rigid& T_world_camera, std::uint32_t seed) const {
  return Look(T_world_camera, seed, Twist());
}

rgbd::Frame SimulatedWorld::Look(const Rigid& T_world_camera, std::uint32_t seed, const Twist& twist) const {
  const WorldParams& params = impl_->params;
  rendering::RenderParams how;
  how.samples_per_axis = params.render_samples_per_axis;
  how.threads = params.render_threads;
  how.ambient = params.ambient;
  rendering::Image image = impl_->Render(T_world_camera, how);
  const std::uint64_t stream = SeedOf(T_world_camera, seed);
  rgbd::Frame frame;
  frame.camera = Camera();
  frame.T_world_camera = T_world_camera;
  frame.depth = MeasuredDepth(image, params.sensor, impl_->noise.StreamOf(stream));
  frame.color = image.color;
  if (params.sensor.motion_blur) BlurByMotion(image.depth, frame.camera, twist, params.sensor.exposure_s, &frame.color);
  AddImageNoise(params.sensor.image_noise, impl_->noise.StreamOf(~stream), &frame.color);
  return frame;
}

void SimulatedWorld::MoveObject(int object, const Rigid& T_world_object) {
  impl_->truth.at(object).T_world_object = T_world_object;
  impl_->scene.Move(object, T_world_object);
}

void SimulatedWorld::ShowObject(int object, bool visible) {
  static_cast<void>(impl_->truth.at(object));
  impl_->scene.SetVisible(object, visible);
}

const Mesh& SimulatedWorld::MeshOf(int object) const { return *impl_->meshes.at(object); }

cv::Mat SimulatedWorld::Labels(const Rigid& T_world_camera) const {
  rendering::RenderParams how;
  how.shaded = false;
  cv::Mat labels = impl_->Render(T_world_camera, how).label;
  labels.setTo(-1, labels >= static_cast<int>(impl_->params.objects.size()));
  return labels;
}

Rigid SimulatedWorld::StartPose() const {
  return geometry::LookAt(impl_->params.start_eye_m, impl_->params.start_target_m, Eigen::Vector3d::UnitZ());
}

geometry::PinholeCamera SimulatedWorld::Camera() const { return CameraOf(impl_->params.sensor); }

motion::Obstacles SimulatedWorld::Furniture() const {
  const WorldParams& params = impl_->params;
  const double size = params.room_size_m, height = params.room_height_m, floor = -params.table_height_m;
  motion::Obstacles furniture;
  // Down to the floor: the camera has nothing to do under the table.
  furniture.boxes.push_back(
      {"table", At({0, 0, floor / 2}), {params.table_size_x_m, params.table_size_y_m, params.table_height_m}});
  furniture.boxes.push_back({"floor", At({0, 0, floor - kWall_m / 2}), {size, size, kWall_m}});
  furniture.boxes.push_back({"ceiling", At({0, 0, floor + height + kWall_m / 2}), {size, size, kWall_m}});
  for (const auto& [name, normal] : Walls()) {
    const Eigen::Vector3d centre = Eigen::Vector3d(0, 0, floor + height / 2) - (size + kWall_m) / 2 * normal;
    const bool across_x = normal.x() != 0.0;
    furniture.boxes.push_back({name, At(centre), {across_x ? kWall_m : size, across_x ? size : kWall_m, height}});
  }
  return furniture;
}

std::vector<TrueObject> SimulatedWorld::Truth() const { return impl_->truth; }

}  // namespace vantage::simulation
