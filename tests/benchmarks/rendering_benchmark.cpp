// Frame times of the renderer at 640 x 480: a table with photo boxes, and the surface of a whole RGB-D frame.
#include <benchmark/benchmark.h>

#include <opencv2/imgproc.hpp>

#include "rendering/scene.h"

namespace {

using namespace vantage;

const geometry::PinholeCamera kCamera{640, 480, 525.0, 525.0, 319.5, 239.5};

cv::Mat Blobs(std::uint32_t seed) {
  cv::Mat image(512, 512, CV_8UC3);
  cv::RNG random(seed);
  random.fill(image, cv::RNG::UNIFORM, 0, 255);
  cv::GaussianBlur(image, image, {}, 3.0);
  cv::normalize(image, image, 0, 255, cv::NORM_MINMAX);
  return image;
}

geometry::Rigid At(double x, double y, double z) {
  geometry::Rigid T = geometry::Rigid::Identity();
  T.translation() = Eigen::Vector3d(x, y, z);
  return T;
}

rendering::Scene Table() {
  rendering::Scene scene;
  scene.Add(std::make_shared<rendering::Mesh>(rendering::RectangleMesh(6, 6, Blobs(9), 0.5)), At(0, 0, 0));
  for (int i = 0; i < 4; ++i) {
    const std::vector<cv::Mat> faces = {Blobs(3 * i), Blobs(3 * i + 1), Blobs(3 * i + 2)};
    scene.Add(std::make_shared<rendering::Mesh>(rendering::BoxMesh({0.16, 0.06, 0.21}, faces)), At(0.2 * i - 0.3, 0.1 * i, 0.105));
  }
  return scene;
}

const geometry::Rigid kPose = geometry::LookAt({0.1, -0.6, 0.4}, {0, 0, 0.08}, {0, 0, 1});

// Arguments: rays a pixel and axis at outlines, threads.
void RenderTable(benchmark::State& state) {
  const rendering::Scene scene = Table();
  rendering::RenderParams params;
  params.samples_per_axis = static_cast<int>(state.range(0));
  params.threads = static_cast<int>(state.range(1));
  for (auto _ : state) benchmark::DoNotOptimize(scene.Render(kCamera, kPose, params).color.data);
}
BENCHMARK(RenderTable)->Args({1, 1})->Args({2, 1})->Args({2, 2})->Unit(benchmark::kMillisecond)->UseRealTime();

rgbd::Frame WholeFrame() {
  const rendering::Image image = Table().Render(kCamera, kPose);
  rgbd::Frame frame;
  frame.camera = kCamera;
  frame.color = image.color;
  image.depth.convertTo(frame.depth, CV_16U, 1000.0);
  return frame;
}

void BuildFrameMesh(benchmark::State& state) {
  const rgbd::Frame frame = WholeFrame();
  for (auto _ : state) {
    rendering::Scene scene;
    scene.Add(std::make_shared<rendering::Mesh>(rendering::MeshFromFrame(frame, {}, kPose, static_cast<int>(state.range(0)))),
              geometry::Rigid::Identity());
  }
}
BENCHMARK(BuildFrameMesh)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond);

void RenderFrameMesh(benchmark::State& state) {
  rendering::Scene scene;
  scene.Add(std::make_shared<rendering::Mesh>(rendering::MeshFromFrame(WholeFrame(), {}, kPose)), geometry::Rigid::Identity());
  rendering::RenderParams params;
  params.shaded = false;
  const geometry::Rigid pose = geometry::LookAt({-0.1, -0.6, 0.5}, {0, 0, 0.08}, {0, 0, 1});
  for (auto _ : state) benchmark::DoNotOptimize(scene.Render(kCamera, pose, params).color.data);
}
BENCHMARK(RenderFrameMesh)->Unit(benchmark::kMillisecond);

}  // namespace
