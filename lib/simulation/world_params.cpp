// Worlds as YAML files.
#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include "config/yaml.h"
#include "simulation/simulated_world.h"

namespace vantage::simulation {
namespace {

namespace fs = std::filesystem;

void Require(bool ok, const std::string& what) {
  if (!ok) throw std::invalid_argument(what);
}

SensorParams ReadSensor(config::Mapping yaml) {
  SensorParams sensor;
  yaml.Get("width", sensor.width);
  yaml.Get("height", sensor.height);
  yaml.Get("focal_length_px", sensor.focal_length_px);
  yaml.Get("min_depth_m", sensor.min_depth_m);
  yaml.Get("max_depth_m", sensor.max_depth_m);
  yaml.Get("depth_noise", sensor.depth_noise);
  yaml.Get("noise_base_m", sensor.noise_base_m);
  yaml.Get("noise_slope", sensor.noise_slope);
  yaml.Get("noise_correlation_px", sensor.noise_correlation_px);
  yaml.Get("depth_quantised", sensor.depth_quantised);
  yaml.Get("baseline_m", sensor.baseline_m);
  yaml.Get("disparity_step_px", sensor.disparity_step_px);
  yaml.Get("depth_holes", sensor.depth_holes);
  yaml.Get("max_grazing_deg", sensor.max_grazing_deg);
  yaml.Get("depth_shadows", sensor.depth_shadows);
  yaml.Get("projector_m", sensor.projector_m);
  yaml.Get("image_noise", sensor.image_noise);
  yaml.Get("motion_blur", sensor.motion_blur);
  yaml.Get("exposure_s", sensor.exposure_s);
  yaml.Finish();
  yaml.Check(sensor);
  return sensor;
}

ObjectParams ReadObject(config::Mapping yaml, const fs::path& folder) {
  ObjectParams object;
  yaml.Get("name", object.name);
  yaml.Get("mesh", object.mesh);
  yaml.Get("box_m", object.box_m);
  yaml.Get("faces", object.faces);
  yaml.Get("position_m", object.position_m);
  yaml.Get("yaw_deg", object.yaw_deg);
  yaml.Finish();
  yaml.Check(object);
  if (!object.mesh.empty()) {
    if (yaml.Has("box_m") || yaml.Has("faces")) yaml.Fail("mesh", "an object is a mesh or a box with faces, not both");
    object.mesh = (folder / object.mesh).lexically_normal().string();
    if (!fs::is_regular_file(object.mesh)) yaml.Fail("mesh", "there is no file " + object.mesh);
  }
  return object;
}

// A name for the object of a mesh file: YCB calls them all "textured".
std::string NameOf(const fs::path& mesh) {
  const std::string stem = mesh.stem().string();
  return stem == "textured" && mesh.has_parent_path() ? mesh.parent_path().filename().string() : stem;
}

}  // namespace

void SensorParams::Check() const {
  Require(width >= 16 && width <= 4096, "sensor.width must be in [16, 4096]");
  Require(height >= 16 && height <= 4096, "sensor.height must be in [16, 4096]");
  Require(focal_length_px > 1.0, "sensor.focal_length_px must be > 1");
  Require(noise_base_m >= 0.0, "sensor.noise_base_m must be >= 0");
  Require(noise_slope >= 0.0, "sensor.noise_slope must be >= 0");
  Require(noise_correlation_px >= 0.0 && noise_correlation_px <= 20.0, "sensor.noise_correlation_px must be in [0, 20]");
  Require(baseline_m > 0.0 && baseline_m < 1.0, "sensor.baseline_m must be in (0, 1)");
  Require(disparity_step_px > 0.0, "sensor.disparity_step_px must be > 0");
  Require(projector_m >= 0.0 && projector_m <= baseline_m, "sensor.projector_m must be in [0, baseline_m]");
  Require(max_grazing_deg > 0.0 && max_grazing_deg <= 90.0, "sensor.max_grazing_deg must be in (0, 90]");
  Require(min_depth_m >= 0.0, "sensor.min_depth_m must be >= 0");
  Require(max_depth_m > min_depth_m && max_depth_m <= 65.0, "sensor.max_depth_m must be in (min_depth_m, 65]");
  Require(image_noise >= 0.0 && image_noise <= 64.0, "sensor.image_noise must be in [0, 64]");
  Require(exposure_s >= 0.0 && exposure_s <= 1.0, "sensor.exposure_s must be in [0, 1]");
}

void ObjectParams::Check() const {
  Require(!name.empty(), "an object needs a name");
  Require(mesh.empty() || faces.empty(), "object " + name + ": it is a mesh or a box with faces, not both");
  Require(!mesh.empty() || !faces.empty(), "object " + name + ": needs a mesh, or faces for a box");
  Require(faces.size() <= 6, "object " + name + ": a box has 6 faces, not " + std::to_string(faces.size()));
  Require(box_m.minCoeff() > 0.0 && box_m.maxCoeff() < 5.0, "object " + name + ": box_m must be in (0, 5) m");
}

void WorldParams::Check() const {
  Require(table_size_x_m > 0.0 && table_size_x_m < room_size_m, "table_size_x_m must be in (0, room_size_m)");
  Require(table_size_y_m > 0.0 && table_size_y_m < room_size_m, "table_size_y_m must be in (0, room_size_m)");
  Require(table_height_m > 0.05 && table_height_m < 2.0, "table_height_m must be in (0.05, 2)");
  Require(room_size_m <= 50.0, "room_size_m must be <= 50");
  Require(room_height_m > table_height_m && room_height_m <= 50.0, "room_height_m must be in (table_height_m, 50]");
  Require(table_tile_m > 0.0, "table_tile_m must be > 0");
  Require(wall_tile_m > 0.0, "wall_tile_m must be > 0");
  Require(ambient >= 0.0 && ambient <= 1.0, "ambient must be in [0, 1]");
  Require(start_eye_m.z() > 0.0 && start_eye_m.head<2>().cwiseAbs().maxCoeff() < room_size_m / 2,
          "start_eye_m must be above the table's plane and inside the room");
  Require((start_eye_m - start_target_m).norm() > 1e-3, "start_target_m must not be start_eye_m");
  Require(render_samples_per_axis >= 1 && render_samples_per_axis <= 8, "render_samples_per_axis must be in [1, 8]");
  Require(render_threads >= 1 && render_threads <= 64, "render_threads must be in [1, 64]");
  sensor.Check();
  std::set<std::string> names;
  for (const ObjectParams& object : objects) {
    object.Check();
    Require(names.insert(object.name).second, "two objects are named " + object.name);
  }
}

WorldParams LoadWorldParams(const fs::path& file) {
  config::Mapping yaml = config::Mapping::Load(file);
  const fs::path folder = fs::absolute(file).parent_path();
  WorldParams world;
  yaml.Get("table_size_x_m", world.table_size_x_m);
  yaml.Get("table_size_y_m", world.table_size_y_m);
  yaml.Get("table_height_m", world.table_height_m);
  yaml.Get("room_size_m", world.room_size_m);
  yaml.Get("room_height_m", world.room_height_m);
  yaml.Get("table_texture", world.table_texture);
  yaml.Get("table_tile_m", world.table_tile_m);
  yaml.Get("wall_texture", world.wall_texture);
  yaml.Get("wall_tile_m", world.wall_tile_m);
  yaml.Get("texture_folders", world.texture_folders);
  yaml.Get("ambient", world.ambient);
  yaml.Get("start_eye_m", world.start_eye_m);
  yaml.Get("start_target_m", world.start_target_m);
  yaml.Get("render_samples_per_axis", world.render_samples_per_axis);
  yaml.Get("render_threads", world.render_threads);
  world.sensor = ReadSensor(yaml.Child("sensor"));
  for (config::Mapping& object : yaml.Children("objects")) world.objects.push_back(ReadObject(object, folder));
  for (std::string& textures : world.texture_folders) textures = (folder / textures).lexically_normal().string();
  yaml.Finish();
  yaml.Check(world);
  return world;
}

WorldParams WorldWithMeshes(const WorldParams& base, const std::vector<fs::path>& meshes) {
  // To the sides and behind, as seen from the start, so that nothing hides the first; far enough apart to be told apart.
  constexpr double kFirst = 75.0 * M_PI / 180.0, kArc = 210.0 * M_PI / 180.0, kApart_m = 0.2;
  const double others = static_cast<double>(meshes.size()) - 1.0;
  const double ring_m = std::max(0.27, kApart_m * (others - 1.0) / kArc);
  const double start = std::atan2(base.start_eye_m.y(), base.start_eye_m.x());
  WorldParams world = base;
  world.objects.clear();
  std::set<std::string> names;
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    ObjectParams object;
    object.mesh = fs::absolute(meshes[i]).lexically_normal().string();
    if (!fs::is_regular_file(object.mesh)) throw std::runtime_error(meshes[i].string() + ": no such mesh file");
    object.name = NameOf(object.mesh);
    for (int again = 2; !names.insert(object.name).second; ++again) object.name = NameOf(object.mesh) + "_" + std::to_string(again);
    if (i > 0) {
      const double angle = start + kFirst + (others > 1.0 ? kArc * (static_cast<double>(i) - 1.0) / (others - 1.0) : 0.0);
      object.position_m = {ring_m * std::cos(angle), ring_m * std::sin(angle), 0.0};
    }
    world.objects.push_back(object);
  }
  return world;
}

}  // namespace vantage::simulation
