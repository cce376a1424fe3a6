// Many objects for benchmarks: boxes and cylinders that wear mixtures of photographs (Debian's package opencv-doc), learned from
// all sides at known poses, and cluttered tables that show some of them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "features/features.h"
#include "geometry/view_sphere.h"
#include "learning/keyframe.h"
#include "rendering/scene.h"
#include "rgbd/frame.h"

namespace vantage::benchmarks {

class Random {
 public:
  explicit Random(std::uint32_t seed) : random_(seed) {}
  double Uniform(double low, double high) { return low + (high - low) * (random_() / 4294967296.0); }
  int Below(int count) { return static_cast<int>(Uniform(0.0, count)); }

 private:
  std::mt19937 random_;
};

inline const std::vector<cv::Mat>& Photographs() {
  static const std::vector<cv::Mat> photographs = [] {
    const std::filesystem::path folder = "/usr/share/doc/opencv-doc/examples/data";
    std::vector<std::filesystem::path> files;
    if (std::filesystem::is_directory(folder)) {
      for (const auto& entry : std::filesystem::directory_iterator(folder)) files.push_back(entry.path());
    }
    std::sort(files.begin(), files.end());
    std::vector<cv::Mat> images;
    for (const auto& file : files) {
      const std::string name = file.filename().string();
      if (file.extension() != ".jpg" && file.extension() != ".png") continue;
      if (name.rfind("left", 0) == 0 || name.rfind("right", 0) == 0 || name.rfind("chessboard", 0) == 0) continue;  // All alike.
      const cv::Mat image = cv::imread(file.string(), cv::IMREAD_COLOR);
      if (!image.empty() && std::min(image.rows, image.cols) >= 240) images.push_back(image);
    }
    if (images.empty()) throw std::runtime_error("no photographs in " + folder.string() + "; install opencv-doc");
    return images;
  }();
  return photographs;
}

// A square out of some photograph, turned and mirrored at random.
inline cv::Mat PhotoCrop(Random& random, int size) {
  const auto& photographs = Photographs();
  const cv::Mat& photo = photographs[random.Below(static_cast<int>(photographs.size()))];
  const int side = static_cast<int>(random.Uniform(0.4, 1.0) * std::min(photo.rows, photo.cols));
  cv::Mat crop;
  cv::resize(photo(cv::Rect(random.Below(photo.cols - side + 1), random.Below(photo.rows - side + 1), side, side)), crop,
             {size, size}, 0, 0, cv::INTER_AREA);
  if (const int turn = random.Below(4); turn < 3) cv::rotate(crop, crop, turn);
  if (random.Below(2) == 0) cv::flip(crop, crop, 1);
  return crop;
}

// Two of them laid over each other: what one face shows, hardly another does.
inline cv::Mat FaceTexture(Random& random) {
  constexpr int kSize = 256;
  cv::Mat face;
  const double share = random.Uniform(0.4, 0.6);
  cv::addWeighted(PhotoCrop(random, kSize), share, PhotoCrop(random, kSize), 1.0 - share, 0.0, face);
  cv::normalize(face, face, 0, 255, cv::NORM_MINMAX);
  return face;
}

// Standing on z = 0 when centred at half its height; the texture once round the side.
inline rendering::Mesh CylinderMesh(double radius_m, double height_m, const cv::Mat& texture) {
  constexpr int kSides = 48;
  rendering::Mesh mesh;
  mesh.texture = texture;
  for (int i = 0; i <= kSides; ++i) {
    const double angle = 2.0 * M_PI * i / kSides;
    for (const double z : {-0.5, 0.5}) {
      mesh.vertices.push_back(Eigen::Vector3d(radius_m * std::cos(angle), radius_m * std::sin(angle), z * height_m).cast<float>());
      mesh.texture_uv.emplace_back(static_cast<float>(i) / kSides, static_cast<float>(z + 0.5));
    }
  }
  for (int i = 0; i < kSides; ++i) {
    mesh.triangles.emplace_back(2 * i, 2 * i + 2, 2 * i + 3);
    mesh.triangles.emplace_back(2 * i, 2 * i + 3, 2 * i + 1);
  }
  const int middle = static_cast<int>(mesh.vertices.size());  // The top wears one point of the texture.
  mesh.vertices.push_back(Eigen::Vector3f(0, 0, static_cast<float>(height_m / 2)));
  mesh.texture_uv.emplace_back(0.5f, 1.f);
  for (int i = 0; i < kSides; ++i) mesh.triangles.emplace_back(middle, 2 * i + 1, 2 * i + 3);
  return mesh;
}

struct Shape {
  std::shared_ptr<const rendering::Mesh> mesh;  // Centred at the origin.
  double height_m = 0.1;
};

// The same for the same number, whatever else was made.
inline Shape MakeShape(int number, std::uint32_t seed) {
  Random random(seed * 7919u + static_cast<std::uint32_t>(number));
  Shape shape;
  if (number % 4 == 3) {
    const double radius_m = random.Uniform(0.035, 0.055);
    shape.height_m = random.Uniform(0.11, 0.18);
    cv::Mat texture;
    cv::hconcat(FaceTexture(random), FaceTexture(random), texture);
    shape.mesh = std::make_shared<rendering::Mesh>(CylinderMesh(radius_m, shape.height_m, texture));
    return shape;
  }
  const Eigen::Vector3d size_m(random.Uniform(0.07, 0.13), random.Uniform(0.07, 0.13), random.Uniform(0.09, 0.18));
  std::vector<cv::Mat> faces;
  for (int i = 0; i < 6; ++i) faces.push_back(FaceTexture(random));
  shape.height_m = size_m.z();
  shape.mesh = std::make_shared<rendering::Mesh>(rendering::BoxMesh(size_m, faces));
  return shape;
}

inline rgbd::Frame ToFrame(const rendering::Image& image, const geometry::PinholeCamera& camera, double noise, std::uint32_t seed) {
  rgbd::Frame frame;
  frame.camera = camera;
  cv::RNG random(seed);
  cv::Mat noisy(image.color.size(), CV_16SC3), color;
  random.fill(noisy, cv::RNG::NORMAL, 0.0, noise);
  image.color.convertTo(color, CV_16SC3);
  cv::add(color, noisy, color);
  color.convertTo(frame.color, CV_8UC3);
  image.depth.convertTo(frame.depth, CV_16U, 1000.0);
  return frame;
}

// The object seen from `views` sides, 25 degrees from above at 0.6 m. Keyframe images are left out: only their camera is needed.
inline std::shared_ptr<const model::ObjectModel> Learn(const std::string& name, const Shape& shape, int views,
                                                       const features::FeatureParams& params) {
  const geometry::PinholeCamera camera{240, 240, 525.0, 525.0, 119.5, 119.5};
  rendering::Scene scene;
  scene.Add(shape.mesh, geometry::Rigid::Identity());
  model::ObjectModel object;
  object.name = name;
  object.feature_fingerprint = params.Fingerprint();
  for (int v = 0; v < views; ++v) {
    const double azimuth = 2.0 * M_PI * v / views, elevation = 25.0 * M_PI / 180.0;
    const Eigen::Vector3d eye(std::cos(azimuth) * std::cos(elevation), std::sin(azimuth) * std::cos(elevation),
                              std::sin(elevation));
    const geometry::Rigid T_object_camera = geometry::LookAt(0.6 * eye, Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ());
    rendering::RenderParams render;
    render.background = cv::Scalar(128, 128, 128);
    const rgbd::Frame frame = ToFrame(scene.Render(camera, T_object_camera, render), camera, 2.0, static_cast<std::uint32_t>(v));
    const cv::Mat mask = frame.depth > 0;
    auto extended = learning::WithView(object, frame, mask, features::Extract(rgbd::Gray(frame), mask, params),
                                       T_object_camera.inverse(), {}, 4);
    if (!extended) continue;
    object = std::move(*extended);
    model::View& view = object.views.back();
    view.id = v;
    view.keyframe.color = view.keyframe.depth = view.mask = cv::Mat();
  }
  return std::make_shared<model::ObjectModel>(std::move(object));
}

struct TableScene {
  rgbd::Frame frame;
  std::vector<std::pair<int, geometry::Rigid>> truth;  // Numbers of the objects, and T_camera_object.
};

// A table on which the numbered objects stand in two rows, the front row hiding parts of the one behind.
inline TableScene MakeTable(const std::vector<int>& numbers, std::uint32_t shape_seed, std::uint32_t seed) {
  const geometry::PinholeCamera camera{640, 480, 525.0, 525.0, 319.5, 239.5};
  Random random(seed);
  rendering::Scene scene;
  scene.Add(std::make_shared<rendering::Mesh>(rendering::RectangleMesh(3.0, 3.0, PhotoCrop(random, 512), 0.6)),
            geometry::Rigid::Identity());
  const geometry::Rigid T_world_camera =
      geometry::LookAt({random.Uniform(-0.1, 0.1), -0.95, 0.5}, {0, 0, 0.06}, Eigen::Vector3d::UnitZ());
  TableScene table;
  const int columns = (static_cast<int>(numbers.size()) + 1) / 2;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const Shape shape = MakeShape(numbers[i], shape_seed);
    const int column = static_cast<int>(i) / 2, row = static_cast<int>(i) % 2;
    geometry::Rigid T_world_object = geometry::Rigid::Identity();
    T_world_object.linear() = Eigen::AngleAxisd(random.Uniform(0, 2.0 * M_PI), Eigen::Vector3d::UnitZ()).toRotationMatrix();
    T_world_object.translation() = Eigen::Vector3d((column - 0.5 * (columns - 1) + 0.4 * row) * 0.19 + random.Uniform(-0.01, 0.01),
                                                   row * 0.22 - 0.11 + random.Uniform(-0.02, 0.02), shape.height_m / 2);
    scene.Add(shape.mesh, T_world_object);
    table.truth.emplace_back(numbers[i], T_world_camera.inverse() * T_world_object);
  }
  rendering::RenderParams render;
  render.samples_per_axis = 2;
  table.frame = ToFrame(scene.Render(camera, T_world_camera, render), camera, 2.0, seed);
  return table;
}

}  // namespace vantage::benchmarks
