// Simulated table-top worlds described in YAML.
#pragma once

#include <filesystem>

#include "rendering/scene.h"
#include "simulation/motion_blur.h"
#include "simulation/world.h"

namespace vantage::simulation {

// A structured-light camera of the Kinect's kind, its depth registered to its colour image; every part can be switched off. Held
// against 45 pictures of a real one (object segmentation data base, residuals of planes fitted to 21 x 21 pixels of the table):
// sigma 1.1 mm at 0.7 m, 2.0 at 1.0, 4.0 at 1.45, here 1.4, 1.9, 3.3; depth steps at 1 m 2.9 mm, here 3.2; correlation with the
// next three neighbours .67 .53 .41 along rows and .50 .26 .07 along columns, here .67 .35 .10 both ways; holes left and right of
// objects 2 to 1, as here.
struct SensorParams {
  int width = 640;
  int height = 480;
  double focal_length_px = 525.0;
  double min_depth_m = 0.3;
  double max_depth_m = 4.0;
  // Noise: Gaussian, sigma = noise_base_m + noise_slope * (z - 0.4 m)^2 (Nguyen, Izadi and Lovell, 2012), quantisation included.
  bool depth_noise = true;
  double noise_base_m = 0.0012;
  double noise_slope = 0.0019;        // 1/m.
  double noise_correlation_px = 1.2;  // Neighbours err alike: white noise smoothed by a Gaussian this wide; 0 = independent.
  // Quantisation: the disparity baseline_m * focal_length_px / z comes in whole steps.
  bool depth_quantised = true;
  double baseline_m = 0.075;  // From the infrared camera to the projector.
  double disparity_step_px = 0.125;
  // Holes at grazing angles and at jumps in depth.
  bool depth_holes = true;
  double max_grazing_deg = 80.0;  // Angle between ray and normal beyond which there is no depth.
  // Shadows: what the projector does not light or the infrared camera does not see beside near objects.
  bool depth_shadows = true;
  double projector_m = 0.05;  // The projector is so far to the right of the colour camera; the rest of the baseline is left.
  double image_noise = 2.0;   // Sigma, grey levels.
  bool motion_blur = true;    // Where the camera's motion is told; see Look.
  double exposure_s = 0.015;

  void Check() const;  // Throws std::invalid_argument naming the field.
};

struct ObjectParams {
  std::string name;
  std::string mesh;  // OBJ or PLY, vertices in metres, z up; in a file: relative to it. Empty for a box:
  Eigen::Vector3d box_m{0.1, 0.1, 0.1};
  std::vector<std::string> faces;  // Photographs the box wears, +x -x +y -y +z -z (1 to 6, repeated); their middles, undistorted.
  Eigen::Vector3d position_m{0, 0, 0};  // World: where the middle of the mesh's bounds stands (z of the lowest point, table = 0).
  double yaw_deg = 0.0;                 // About z, counter-clockwise from above.

  void Check() const;  // Throws std::invalid_argument naming the object and the field.
};

struct WorldParams {
  double table_size_x_m = 1.2;  // Table top at z = 0, centred.
  double table_size_y_m = 0.8;
  double table_height_m = 0.75;  // Above the floor.
  double room_size_m = 4.0;      // Square room around the table.
  double room_height_m = 2.5;
  std::string table_texture;  // Image file name, or empty for plain (a faint grain).
  double table_tile_m = 1.2;  // The texture repeats after this length.
  std::string wall_texture;
  double wall_tile_m = 2.0;
  // Where photographs are looked for, first match; in a file: relative to it. The default is Debian's package opencv-doc.
  std::vector<std::string> texture_folders = {"/usr/share/doc/opencv-doc/examples/data"};
  Eigen::Vector3d start_eye_m{0.55, 0.0, 0.45};
  Eigen::Vector3d start_target_m{0, 0, 0.08};
  double ambient = 0.55;  // Share of the light that comes from everywhere, [0, 1].
  SensorParams sensor;
  std::vector<ObjectParams> objects;
  int render_samples_per_axis = 2;  // Rays a pixel and axis at outlines.
  int render_threads = 1;           // The pictures do not depend on it.

  void Check() const;  // Throws std::invalid_argument naming the field.
};

// Throws std::runtime_error naming file and line: missing, broken YAML, unknown key, wrong type, a field out of range, no such
// mesh.
WorldParams LoadWorldParams(const std::filesystem::path& file);

// The same room with these meshes instead of the objects: the first at the centre, the others to its sides and
// behind it as seen from the start (0.27 m away or more). Named by their
// files (YCB's textured.obj: by their folders). Throws std::runtime_error where a file does not exist.
WorldParams WorldWithMeshes(const WorldParams& base, const std::vector<std::filesystem::path>& meshes);

class SimulatedWorld : public World {
 public:
  // Throws std::runtime_error where a mesh or texture cannot be read (absent photographs: names the package opencv-doc), and
  // std::invalid_argument as Check does.
  explicit SimulatedWorld(const WorldParams& params);
  ~SimulatedWorld() override;

  // utime and id are left 0 for the caller to fill in. About 60 ms at 640 x 480 on one core, 80 in motion.
  rgbd::Frame Look(const geometry::Rigid& T_world_camera, std::uint32_t seed) const override;
  std::vector<geometry::Rigid> Viewpoints() const override { return {}; }
  // ...by a camera that moves while the shutter is open (sensor.motion_blur, exposure_s).
  rgbd::Frame Look(const geometry::Rigid& T_world_camera, std::uint32_t seed, const Twist& twist) const;

  // Things happen in the world. `object` is an index into params.objects. Not while another thread looks.
  void MoveObject(int object, const geometry::Rigid& T_world_object);
  void ShowObject(int object, bool visible);  // Hidden ones are in Truth() all the same.
  const rendering::Mesh& MeshOf(int object) const;

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
