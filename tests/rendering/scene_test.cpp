#include "rendering/scene.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "rgbd/bop.h"
#include "support/data.h"

namespace vantage::rendering {
namespace {

using geometry::PinholeCamera;
using geometry::Rigid;

const PinholeCamera kCamera{320, 240, 260.0, 260.0, 159.5, 119.5};

RenderParams Unlit() {
  RenderParams params;
  params.shaded = false;
  return params;
}

// Four quarters of different colour: which way up and round is a matter of looking.
cv::Mat Quarters() {
  cv::Mat image(200, 200, CV_8UC3);
  image(cv::Rect(0, 0, 100, 100)).setTo(cv::Scalar(255, 0, 0));
  image(cv::Rect(100, 0, 100, 100)).setTo(cv::Scalar(0, 255, 0));
  image(cv::Rect(0, 100, 100, 100)).setTo(cv::Scalar(0, 0, 255));
  image(cv::Rect(100, 100, 100, 100)).setTo(cv::Scalar(255, 255, 255));
  return image;
}

cv::Mat Blobs(std::uint32_t seed, int size = 256) {
  cv::Mat image(size, size, CV_8UC3);
  cv::RNG random(seed);
  random.fill(image, cv::RNG::UNIFORM, 0, 255);
  cv::GaussianBlur(image, image, {}, 3.0);
  cv::normalize(image, image, 0, 255, cv::NORM_MINMAX);
  return image;
}

std::shared_ptr<const Mesh> Shared(Mesh mesh) { return std::make_shared<const Mesh>(std::move(mesh)); }

Rigid At(double x, double y, double z) {
  Rigid T = Rigid::Identity();
  T.translation() = Eigen::Vector3d(x, y, z);
  return T;
}

TEST(Scene, DepthOfABoxIsExact) {
  Scene scene;
  const Rigid T_world_box = At(0.1, -0.2, 0.3) * Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized());
  const Eigen::Vector3d half(0.1, 0.15, 0.05);
  scene.Add(Shared(BoxMesh(2 * half, {Quarters()})), T_world_box);
  const Rigid T_world_camera = geometry::LookAt({0.8, 0.3, 0.9}, T_world_box.translation(), Eigen::Vector3d::UnitZ());
  const Image image = scene.Render(kCamera, T_world_camera);
  const Rigid T_box_camera = T_world_box.inverse() * T_world_camera;
  int hits = 0;
  for (int y = 0; y < kCamera.height; ++y) {
    for (int x = 0; x < kCamera.width; ++x) {
      // The ray and the box by the slab method, in double precision.
      const Eigen::Vector3d eye = T_box_camera.translation();
      const Eigen::Vector3d ray = T_box_camera.linear() * kCamera.Unproject({x, y}, 1.0);
      const Eigen::Array3d a = (half - eye).array() / ray.array(), b = (-half - eye).array() / ray.array();
      const double enter = a.min(b).maxCoeff(), leave = a.max(b).minCoeff();
      const float depth = image.depth.at<float>(y, x);
      if (leave - enter < 1e-4 && leave - enter > -1e-4) continue;  // The very outline.
      ASSERT_EQ(enter<leave, depth> 0.0f) << x << ' ' << y;
      EXPECT_EQ(image.label.at<int>(y, x), depth > 0.0f ? 0 : -1);
      if (depth == 0.0f) continue;
      ++hits;
      ASSERT_NEAR(depth, enter, 1e-4) << x << ' ' << y;
    }
  }
  EXPECT_GT(hits, 3000);
}

TEST(Scene, NearerInstancesHideAndHiddenOnesDoNot) {
  Scene scene;
  const auto box = Shared(BoxMesh({0.2, 0.2, 0.2}, {Quarters()}));
  const int near = scene.Add(box, At(0, 0, 1.0));
  const int far = scene.Add(box, At(0.15, 0, 2.0));
  Image image = scene.Render(kCamera, Rigid::Identity());
  EXPECT_EQ(image.label.at<int>(120, 160), near);
  EXPECT_NEAR(image.depth.at<float>(120, 160), 0.9, 1e-4);
  EXPECT_EQ(image.label.at<int>(120, 190), far);
  EXPECT_EQ(image.label.at<int>(10, 10), -1);
  EXPECT_EQ(image.depth.at<float>(10, 10), 0.0f);
  scene.SetVisible(near, false);
  image = scene.Render(kCamera, Rigid::Identity());
  EXPECT_EQ(image.label.at<int>(120, 170), far);
  scene.SetVisible(near, true);
  scene.Move(near, At(0, 0, 3.0));
  image = scene.Render(kCamera, Rigid::Identity());
  EXPECT_EQ(image.label.at<int>(120, 170), far);
  EXPECT_NEAR(image.depth.at<float>(120, 155), 2.9, 1e-4);
  EXPECT_THROW(scene.Move(7, At(0, 0, 0)), std::out_of_range);
}

// All faces of a box show their picture upright and not mirrored.
TEST(Scene, PicturesAreUpright) {
  Scene scene;
  scene.Add(Shared(BoxMesh({0.4, 0.4, 0.4}, {Quarters()})), Rigid::Identity());
  for (const Eigen::Vector3d& side : {Eigen::Vector3d(1, 0, 0), {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}) {
    const Eigen::Vector3d up = side.z() == 0.0 ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d::UnitY();
    const Image image = scene.Render(kCamera, geometry::LookAt(side, {0, 0, 0}, up), Unlit());
    EXPECT_EQ(image.color.at<cv::Vec3b>(120 - 30, 160 - 30), cv::Vec3b(255, 0, 0)) << side.transpose();
    EXPECT_EQ(image.color.at<cv::Vec3b>(120 - 30, 160 + 30), cv::Vec3b(0, 255, 0)) << side.transpose();
    EXPECT_EQ(image.color.at<cv::Vec3b>(120 + 30, 160 - 30), cv::Vec3b(0, 0, 255)) << side.transpose();
    EXPECT_EQ(image.color.at<cv::Vec3b>(120 + 30, 160 + 30), cv::Vec3b(255, 255, 255)) << side.transpose();
  }
}

TEST(Scene, LightFallsFromItsSide) {
  Scene scene;
  scene.Add(Shared(BoxMesh({0.4, 0.4, 0.4}, {cv::Mat(8, 8, CV_8UC3, cv::Scalar::all(200))})), Rigid::Identity());
  RenderParams params;
  params.light_in_world = {1, 0, 0};
  params.ambient = 0.5;
  const Image lit = scene.Render(kCamera, geometry::LookAt({1, 0, 0}, {0, 0, 0}, {0, 0, 1}), params);
  const Image dark = scene.Render(kCamera, geometry::LookAt({-1, 0, 0}, {0, 0, 0}, {0, 0, 1}), params);
  EXPECT_NEAR(lit.color.at<cv::Vec3b>(120, 160)[0], 200, 1);
  EXPECT_NEAR(dark.color.at<cv::Vec3b>(120, 160)[0], 100, 1);
  EXPECT_NEAR(lit.grazing.at<float>(120, 160), 1.0, 1e-3);
}

// A checkerboard far finer than the pixels is grey, seen straight and aslant; unfiltered it would be black and white.
TEST(Scene, FineTexturesDoNotAlias) {
  cv::Mat fine(512, 512, CV_8UC3);
  for (int y = 0; y < 512; ++y)
    for (int x = 0; x < 512; ++x) fine.at<cv::Vec3b>(y, x) = cv::Vec3b::all((x + y) % 2 ? 255 : 0);
  Scene scene;
  scene.Add(Shared(RectangleMesh(4, 4, fine, 0.5)), Rigid::Identity());
  for (const Eigen::Vector3d& eye : {Eigen::Vector3d(0, 0, 3), {0.1, -1.5, 0.5}}) {
    const Image image = scene.Render(kCamera, geometry::LookAt(eye, {0, 0, 0}, {0, 1, 0}), Unlit());
    cv::Scalar mean, deviation;
    cv::meanStdDev(image.color, mean, deviation, image.label >= 0);
    EXPECT_NEAR(mean[0], 127.5, 3.0);
    EXPECT_LT(deviation[0], 12.0);
  }
}

// The filtered image is what averaging many rays a pixel gives.
TEST(Scene, FilterAgreesWithBruteForce) {
  Scene scene;
  scene.Add(Shared(RectangleMesh(4, 4, Blobs(5), 0.8)), Rigid::Identity());
  const Rigid pose = geometry::LookAt({0.3, -1.2, 0.7}, {0, 0, 0}, {0, 0, 1});
  const Image image = scene.Render(kCamera, pose, Unlit());
  cv::Mat large;
  cv::resize(scene.Render(kCamera.Scaled(6.0), pose, Unlit()).color, large, cv::Size(320, 240), 0, 0, cv::INTER_AREA);
  const double difference = cv::norm(image.color, large, cv::NORM_L1) / (3.0 * 320 * 240);
  EXPECT_LT(difference, 3.0);
}

TEST(Scene, SameWithAnyNumberOfThreadsAndEveryTime) {
  Scene scene;
  scene.Add(Shared(BoxMesh({0.3, 0.2, 0.2}, {Blobs(1), Blobs(2)})), At(0, 0, 0.1));
  scene.Add(Shared(RectangleMesh(2, 2, Blobs(3), 0.5)), Rigid::Identity());
  const Rigid pose = geometry::LookAt({0.5, 0.4, 0.5}, {0, 0, 0}, {0, 0, 1});
  RenderParams params;
  params.samples_per_axis = 2;
  const Image once = scene.Render(kCamera, pose, params);
  for (int threads : {1, 2, 3}) {
    params.threads = threads;
    const Image again = scene.Render(kCamera, pose, params);
    EXPECT_EQ(cv::norm(once.color, again.color, cv::NORM_INF), 0.0);
    EXPECT_EQ(cv::norm(once.depth, again.depth, cv::NORM_INF), 0.0);
    EXPECT_EQ(cv::norm(once.label, again.label, cv::NORM_INF), 0.0);
  }
}

// More rays smooth outlines and leave the inside of surfaces as it is.
TEST(Scene, MoreRaysSmoothOutlines) {
  Scene scene;
  scene.Add(Shared(BoxMesh({0.3, 0.3, 0.3}, {cv::Mat(8, 8, CV_8UC3, cv::Scalar::all(200))})), Rigid::Identity());
  const Rigid pose = geometry::LookAt({1, 0, 0}, {0, 0, 0}, {0, 0.2, 1});
  RenderParams params = Unlit();
  const Image coarse = scene.Render(kCamera, pose, params);
  params.samples_per_axis = 3;
  const Image fine = scene.Render(kCamera, pose, params);
  const auto mixed = [](const Image& image) {
    cv::Mat gray;
    cv::extractChannel(image.color, gray, 0);
    return cv::countNonZero((gray > 20) & (gray < 180));
  };
  EXPECT_GT(mixed(fine), 200);
  EXPECT_EQ(mixed(coarse), 0);
  EXPECT_NEAR(fine.color.at<cv::Vec3b>(120, 160)[0], 200, 1);
}

TEST(Scene, MalformedMeshesAndParamsAreRefused) {
  Scene scene;
  Mesh mesh = BoxMesh({1, 1, 1}, {Quarters()});
  mesh.triangles[0][1] = 24;
  EXPECT_THROW(scene.Add(Shared(mesh), Rigid::Identity()), std::invalid_argument);
  mesh.triangles[0][1] = 1;
  mesh.texture_uv.clear();
  EXPECT_THROW(scene.Add(Shared(mesh), Rigid::Identity()), std::invalid_argument);
  EXPECT_EQ(scene.Add(Shared({}), Rigid::Identity()), 0);
  RenderParams params;
  params.samples_per_axis = 0;
  EXPECT_THROW(scene.Render(kCamera, Rigid::Identity(), params), std::invalid_argument);
}

// --- MeshFromFrame --------------------------------------------------------------------------------------------------

rgbd::Frame ToFrame(const Image& image, const PinholeCamera& camera) {
  rgbd::Frame frame;
  frame.color = image.color;
  image.depth.convertTo(frame.depth, CV_16U, 1000.0);
  frame.camera = camera;
  return frame;
}

struct TableTop {
  Scene scene;
  TableTop() {
    scene.Add(Shared(BoxMesh({0.16, 0.06, 0.21}, {Blobs(1), Blobs(2), Blobs(3)})), At(0, 0, 0.105));
    scene.Add(Shared(RectangleMesh(2, 2, Blobs(4), 0.5)), Rigid::Identity());
  }
};

TEST(MeshFromFrame, SamePoseShowsTheSameFrame) {
  const TableTop world;
  const Rigid T_world_camera = geometry::LookAt({0.2, -0.6, 0.4}, {0, 0, 0.08}, {0, 0, 1});
  const Image image = world.scene.Render(kCamera, T_world_camera, Unlit());
  Scene copy;
  copy.Add(Shared(MeshFromFrame(ToFrame(image, kCamera), {}, T_world_camera)), Rigid::Identity());
  const Image again = copy.Render(kCamera, T_world_camera, Unlit());
  int seen = 0, wrong_depth = 0;
  double difference = 0.0;
  for (int y = 1; y + 1 < kCamera.height; ++y) {
    for (int x = 1; x + 1 < kCamera.width; ++x) {
      if (again.label.at<int>(y, x) < 0) continue;
      ++seen;
      wrong_depth += std::abs(again.depth.at<float>(y, x) - image.depth.at<float>(y, x)) > 0.001f;
      difference +=
          cv::norm(cv::Vec3i(again.color.at<cv::Vec3b>(y, x)) - cv::Vec3i(image.color.at<cv::Vec3b>(y, x)), cv::NORM_L1) / 3;
    }
  }
  EXPECT_GT(seen, 0.97 * cv::countNonZero((image.depth > 0) & (image.depth < 0.9)));  // Farther, the table is too slanted.
  EXPECT_LT(wrong_depth, 0.01 * seen);
  EXPECT_LT(difference / seen, 3.0);
}

TEST(MeshFromFrame, OtherPoseShowsWhatAnotherCameraSees) {
  const TableTop world;
  const Rigid T_world_camera = geometry::LookAt({0.2, -0.6, 0.4}, {0, 0, 0.08}, {0, 0, 1});
  const Rigid T_world_other = geometry::LookAt({0.0, -0.6, 0.45}, {0, 0, 0.08}, {0, 0, 1}, 0.3);
  Scene copy;
  copy.Add(Shared(MeshFromFrame(ToFrame(world.scene.Render(kCamera, T_world_camera, Unlit()), kCamera), {}, T_world_camera)),
           Rigid::Identity());
  const Image truth = world.scene.Render(kCamera, T_world_other, Unlit());
  const Image warped = copy.Render(kCamera, T_world_other, Unlit());
  cv::Mat close = (cv::abs(warped.depth - truth.depth) < 0.003) & (warped.label >= 0);
  EXPECT_GT(cv::countNonZero(close), 0.85 * cv::countNonZero((truth.depth > 0) & (truth.depth < 0.9)));
  EXPECT_GT(cv::countNonZero(close), 0.97 * cv::countNonZero(warped.label >= 0));
  EXPECT_LT(cv::norm(warped.color, truth.color, cv::NORM_L1, close) / (3.0 * cv::countNonZero(close)), 8.0);
}

TEST(MeshFromFrame, MaskJumpsAndHolesAreRespected) {
  rgbd::Frame frame;
  frame.camera = kCamera;
  frame.color = cv::Mat(240, 320, CV_8UC3, cv::Scalar(1, 2, 3));
  frame.depth = cv::Mat(240, 320, CV_16UC1, cv::Scalar(1000));
  frame.depth(cv::Rect(160, 0, 160, 240)).setTo(1200);  // A step of 20 cm.
  frame.depth.at<std::uint16_t>(100, 50) = 0;           // A pinhole.
  frame.depth(cv::Rect(80, 100, 10, 10)).setTo(0);      // A real hole.
  Scene scene;
  scene.Add(Shared(MeshFromFrame(frame, {}, Rigid::Identity())), Rigid::Identity());
  const Image image = scene.Render(kCamera, Rigid::Identity());
  EXPECT_NEAR(image.depth.at<float>(100, 50), 1.0, 1e-4);
  EXPECT_EQ(image.label.at<int>(105, 85), -1);
  const Image aside = scene.Render(kCamera, At(-0.5, 0, 0));  // Looks into the gap that the step leaves.
  EXPECT_GT(cv::countNonZero(aside.label.row(120) < 0), 10);

  cv::Mat mask = cv::Mat::zeros(240, 320, CV_8UC1);
  mask(cv::Rect(20, 20, 40, 40)).setTo(255);
  Scene masked;
  masked.Add(Shared(MeshFromFrame(frame, mask, Rigid::Identity(), 2)), Rigid::Identity());
  const cv::Mat seen = masked.Render(kCamera, Rigid::Identity()).label >= 0;
  EXPECT_GT(cv::countNonZero(seen), 1300);
  EXPECT_EQ(cv::countNonZero(seen & (mask == 0)), 0);

  EXPECT_TRUE(MeshFromFrame(frame, cv::Mat::zeros(240, 320, CV_8UC1), Rigid::Identity()).triangles.empty());
  EXPECT_THROW(MeshFromFrame(frame, {}, Rigid::Identity(), 0), std::invalid_argument);
}

double Correlation(const cv::Mat& a, const cv::Mat& b, const cv::Mat& mask) {
  cv::Mat x, y;
  a.convertTo(x, CV_32F);
  b.convertTo(y, CV_32F);
  x -= cv::mean(x, mask)[0];
  y -= cv::mean(y, mask)[0];
  return cv::mean(x.mul(y), mask)[0] / std::sqrt(cv::mean(x.mul(x), mask)[0] * cv::mean(y.mul(y), mask)[0]);
}

// A scan at its true pose looks like the photograph and covers the same pixels.
TEST(Scene, ScanMatchesThePhotograph) {
  VANTAGE_NEEDS_DATA("board");
  VANTAGE_NEEDS_DATA("meshes");
  const rgbd::BopScene recording(testing::DataFolder() / "board");
  const int id = 0;
  const rgbd::Frame frame = recording.Load(id);
  Scene scene;
  for (const rgbd::ObjectTruth& truth : recording.Truth(id)) {
    if (truth.object_id != 3) continue;
    scene.Add(Shared(LoadMesh(testing::DataFolder() / "meshes/003_cracker_box/textured.obj")), truth.T_camera_object);
  }
  RenderParams params = Unlit();
  params.samples_per_axis = 2;
  const Image image = scene.Render(frame.camera, Rigid::Identity(), params);
  const cv::Mat seen = image.label >= 0, labelled = recording.LoadLabel(id) == 1;
  EXPECT_GT(cv::countNonZero(seen & labelled), 0.97 * cv::countNonZero(seen | labelled));
  // The pictures agree best where they lie on each other (to the pose's error): the print differs a little, the light a lot.
  cv::Mat real, drawn, inside;
  cv::cvtColor(frame.color, real, cv::COLOR_BGR2GRAY);
  cv::cvtColor(image.color, drawn, cv::COLOR_BGR2GRAY);
  cv::erode(seen & labelled, inside, cv::Mat::ones(25, 25, CV_8U));
  const cv::Rect region = cv::boundingRect(inside);
  double best = -1.0;
  cv::Point best_shift;
  for (int dy = -10; dy <= 10; ++dy) {
    for (int dx = -10; dx <= 10; ++dx) {
      const double now = Correlation(real(region), drawn(region + cv::Point(dx, dy)), inside(region));
      if (now > best) best_shift = {dx, dy};
      best = std::max(best, now);
    }
  }
  EXPECT_GT(best, 0.4);
  EXPECT_LE(cv::norm(best_shift), 4.0) << best_shift;
  if (const char* folder = std::getenv("VANTAGE_TEST_PICTURES")) {
    cv::Mat both;
    cv::hconcat(frame.color, image.color, both);
    cv::imwrite(std::string(folder) + "/photograph_and_scan.png", both);
  }
}

}  // namespace
}  // namespace vantage::rendering
