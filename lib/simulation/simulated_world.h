// Simulated table-top worlds described in YAML.
#pragma once

#include <filesystem>

#include "rendering/scene.h"
#include "simulation/world.h"

namespace vantage::simulation {

struct SensorParams {
  int width = 640;
  int height = 480;
  double focal_length_px = 525.0;
  bool depth_noise = true;  // Gaussian, sigma growing with depth: noise_base_m + noise_slope * (z - 0.4 m)^2.
  double noise_base_m = 0.0012;
  double noise_slope = 0.0019;
  bool depth_holes = true;        // No depth at grazing angles and jumps.
  double max_grazing_deg = 80.0;  // Angle between ray and normal beyond which there is no depth.
  double min_depth_m = 0.3;
  double max_depth_m = 4.0;
  double image_noise = 2.0;  // Sigma, grey levels.

  void Check() const;  // Throws std::invalid_argument naming the field.
};

struct ObjectParams {
  std::string name;
  std::string mesh;  // OBJ or PLY, relative to the world file; or empty for a box:
  Eigen::Vector3d box_m{0.1, 0.1, 0.1};
  std::vector<std::string> faces;       // Photographs the box wears, +x -x +y -y +z -z; found in `texture_folders`.
  Eigen::Vector3d position_m{0, 0, 0};  // World, of the foot: the mesh's lowest point stands at this height (z, table = 0).
  double yaw_deg = 0.0;
};

struct WorldParams {
  double table_size_x_m = 1.2;  // Table top at z = 0, centred.
  double table_size_y_m = 0.8;
  double room_size_m = 4.0;   // Square room, walls wear `wall_texture`.
  std::string table_texture;  // Image file name, or empty for plain.
  std::string wall_texture;
  std::vector<std::string> texture_folders = {"/usr/share/doc/opencv-doc/examples/data"};
  Eigen::Vector3d start_eye_m{0.55, 0.0, 0.45};
  Eigen::Vector3d start_target_m{0, 0, 0.08};
  SensorParams sensor;
  std::vector<ObjectParams> objects;
  int render_samples_per_axis = 2;

  void Check() const;
};

// Throws std::runtime_error naming file and line: missing, broken YAML, unknown key, wrong type, a field out of range, no such
// mesh.
WorldParams LoadWorldParams(const std::filesystem::path& file);

class SimulatedWorld : public World {
 public:
  // Throws std::runtime_error where a mesh or texture cannot be read.
  explicit SimulatedWorld(const WorldParams& params);
  ~SimulatedWorld() override;

  rgbd::Frame Look(const geometry::Rigid& T_world_camera, std::uint32_t seed) const override;
  std::vector<geometry::Rigid> Viewpoints() const override { return {}; }
  geometry::Rigid StartPose() const override;
  geometry::PinholeCamera Camera() const override;
  motion::Obstacles Furniture() const override;
  std::vector<TrueObject> Truth() const override;

  // Instance label of every pixel from a pose (index into params.objects; -1 = none or furniture), CV_32SC1: for judging
  // visibility.
  cv::Mat Labels(const geometry::Rigid& T_world_camera) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vantage::simulation
