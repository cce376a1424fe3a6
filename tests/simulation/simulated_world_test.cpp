#include "simulation/simulated_world.h"

#include <gtest/gtest.h>

#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "support/data.h"

namespace vantage::simulation {
namespace {

using geometry::Rigid;
namespace fs = std::filesystem;

const fs::path kWorlds = fs::path(VANTAGE_SOURCE_DIR) / "config" / "worlds";

// A world that needs no files: one box wearing pictures written by the test.
class SmallWorld : public ::testing::Test {
 protected:
  SmallWorld() : folder_(fs::path(::testing::TempDir()) / ("world_" + std::to_string(::getpid()))) {
    fs::create_directories(folder_);
    cv::Mat picture(200, 300, CV_8UC3);
    cv::RNG random(3);
    random.fill(picture, cv::RNG::UNIFORM, 0, 255);
    cv::GaussianBlur(picture, picture, {}, 3.0);
    cv::normalize(picture, picture, 0, 255, cv::NORM_MINMAX);
    cv::imwrite((folder_ / "picture.png").string(), picture);
    params_.texture_folders = {folder_.string()};
    ObjectParams box;
    box.name = "box";
    box.box_m = {0.1, 0.2, 0.15};
    box.faces = {"picture.png"};
    params_.objects = {box};
  }
  ~SmallWorld() override { fs::remove_all(folder_); }

  fs::path Write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  template <typename Action>
  static std::string ErrorOf(const Action& action) {
    try {
      action();
    } catch (const std::exception& error) {
      return error.what();
    }
    return "no error";
  }

  fs::path folder_;
  WorldParams params_;
};

TEST_F(SmallWorld, LookIsDeterministicInPoseAndSeed) {
  const SimulatedWorld world(params_);
  const SimulatedWorld again(params_);
  const rgbd::Frame a = world.Look(world.StartPose(), 7), b = again.Look(world.StartPose(), 7),
                    c = world.Look(world.StartPose(), 8);
  rgbd::CheckFrame(a);
  EXPECT_EQ(cv::norm(a.color, b.color, cv::NORM_INF), 0.0);
  EXPECT_EQ(cv::norm(a.depth, b.depth, cv::NORM_INF), 0.0);
  EXPECT_GT(cv::norm(a.color, c.color, cv::NORM_INF), 0.0);
  EXPECT_GT(cv::norm(a.depth, c.depth, cv::NORM_INF), 0.0);
  ASSERT_TRUE(a.T_world_camera.has_value());
  EXPECT_TRUE(a.T_world_camera->isApprox(world.StartPose()));
}

// Depth unprojected by the pose lands on the table or the box, where the truth says they are.
TEST_F(SmallWorld, DepthAgreesWithTheTruth) {
  params_.sensor.depth_noise = params_.sensor.depth_quantised = false;
  const SimulatedWorld world(params_);
  const rgbd::Frame frame = world.Look(world.StartPose(), 1);
  const cv::Mat labels = world.Labels(world.StartPose());
  const TrueObject truth = world.Truth().front();
  Eigen::Vector3d lower = (truth.T_world_object * truth.points).rowwise().minCoeff();
  Eigen::Vector3d upper = (truth.T_world_object * truth.points).rowwise().maxCoeff();
  EXPECT_LT((lower - Eigen::Vector3d(-0.05, -0.1, 0.0)).norm(), 0.01);
  EXPECT_LT((upper - Eigen::Vector3d(0.05, 0.1, 0.15)).norm(), 0.01);
  int on_box = 0, on_table = 0;
  for (int y = 0; y < frame.depth.rows; ++y) {
    for (int x = 0; x < frame.depth.cols; ++x) {
      const std::uint16_t depth = frame.depth.at<std::uint16_t>(y, x);
      if (depth == 0) continue;
      const Eigen::Vector3d p = *frame.T_world_camera * frame.camera.Unproject({x, y}, depth * 1e-3);
      if (labels.at<int>(y, x) == 0) {
        ++on_box;
        EXPECT_GT((Eigen::Vector3d(0.052, 0.102, 0.152) - p.cwiseAbs()).minCoeff(), 0.0) << p.transpose();
        EXPECT_GT(p.z(), -0.002);
      } else if (p.head<2>().cwiseAbs().maxCoeff() < 0.35) {
        ++on_table;
        EXPECT_NEAR(p.z(), 0.0, 0.002);
      }
    }
  }
  EXPECT_GT(on_box, 5000);
  EXPECT_GT(on_table, 20000);
}

TEST_F(SmallWorld, SensorNoiseIsWhatWasAskedFor) {
  SensorParams& sensor = params_.sensor;
  sensor.noise_base_m = 0.004;
  sensor.noise_slope = 0.0;
  sensor.depth_holes = sensor.depth_quantised = false;
  const SimulatedWorld noisy(params_);
  params_.sensor.depth_noise = false;
  params_.sensor.image_noise = 0.0;
  const SimulatedWorld clean(params_);
  const rgbd::Frame a = noisy.Look(noisy.StartPose(), 1), b = clean.Look(noisy.StartPose(), 1);
  cv::Mat depth_a, depth_b, color_a, color_b;
  a.depth.convertTo(depth_a, CV_32F);
  b.depth.convertTo(depth_b, CV_32F);
  cv::Scalar mean, deviation;
  cv::meanStdDev(depth_a - depth_b, mean, deviation, (a.depth > 0) & (b.depth > 0));
  EXPECT_NEAR(mean[0], 0.0, 0.1);
  EXPECT_NEAR(deviation[0], 4.0, 0.15);
  a.color.convertTo(color_a, CV_32F);
  b.color.convertTo(color_b, CV_32F);
  cv::Mat middle;  // Not clipped at black or white.
  cv::inRange(b.color, cv::Scalar::all(20), cv::Scalar::all(235), middle);
  cv::meanStdDev(color_a - color_b, mean, deviation, middle);
  EXPECT_NEAR(mean[0], 0.0, 0.1);
  EXPECT_NEAR(deviation[0], 2.0, 0.1);
}

TEST_F(SmallWorld, HolesAtEdgesGrazingAnglesAndOutOfRange) {
  params_.sensor.depth_noise = false;
  params_.sensor.max_depth_m = 1.5;
  const SimulatedWorld world(params_);
  const rgbd::Frame frame = world.Look(world.StartPose(), 1);
  double largest;
  cv::minMaxLoc(frame.depth, nullptr, &largest);
  EXPECT_LE(largest, 1500.0);
  // Just behind the upper edge of the box there is a shadow.
  const cv::Mat labels = world.Labels(world.StartPose());
  int behind = 0, lost = 0;
  for (int y = 1; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      if (labels.at<int>(y, x) != 0 || labels.at<int>(y - 1, x) == 0) continue;
      ++behind;
      lost += frame.depth.at<std::uint16_t>(y - 1, x) == 0;
    }
  }
  EXPECT_GT(behind, 50);
  EXPECT_GT(lost, 0.8 * behind);
  // Along the table: grazing.
  const Rigid flat = geometry::LookAt({0.65, 0.3, 0.02}, {-0.2, 0.3, 0.0}, {0, 0, 1});
  EXPECT_EQ(cv::countNonZero(world.Look(flat, 1).depth.rowRange(300, 480)), 0);
}

TEST_F(SmallWorld, FurnitureHoldsTheTableAndTheWalls) {
  const motion::Obstacles furniture = SimulatedWorld(params_).Furniture();
  ASSERT_EQ(furniture.boxes.size(), 7u);
  EXPECT_EQ(furniture.boxes[0].name, "table");
  EXPECT_NEAR(furniture.boxes[0].T_world_box.translation().z() + furniture.boxes[0].size_m.z() / 2, 0.0, 1e-12);
  for (const motion::BoxObstacle& box : furniture.boxes) {  // None holds the place where the camera starts.
    const Eigen::Vector3d start = box.T_world_box.inverse() * params_.start_eye_m;
    EXPECT_GT((start.cwiseAbs() - box.size_m / 2).maxCoeff(), 0.0) << box.name;
  }
}

TEST_F(SmallWorld, MissingPhotographsNameThePackage) {
  params_.objects[0].faces = {"gone.jpg"};
  const std::string error = ErrorOf([&] { SimulatedWorld world(params_); });
  EXPECT_NE(error.find("gone.jpg"), std::string::npos) << error;
  EXPECT_NE(error.find("opencv-doc"), std::string::npos) << error;
}

TEST_F(SmallWorld, FileErrorsNameFileAndLine) {
  const auto error_of = [&](const std::string& text) { return ErrorOf([&] { LoadWorldParams(Write("world.yaml", text)); }); };
  EXPECT_NE(error_of("table_size_x_m: 1\nsensr: 3\n").find("world.yaml:2: unknown key 'sensr'"), std::string::npos);
  EXPECT_NE(error_of("table_size_x_m: wide\n").find("world.yaml:1"), std::string::npos);
  EXPECT_NE(error_of("\nsensor:\n  image_noise: -1\n").find("image_noise"), std::string::npos);
  EXPECT_NE(error_of("objects:\n  - name: a\n    mesh: gone.obj\n").find("world.yaml:3: mesh: there is no file"),
            std::string::npos);
  EXPECT_NE(error_of("objects:\n  - name: a\n").find("object a: needs a mesh"), std::string::npos);
  EXPECT_NE(error_of("objects:\n  - {name: a, faces: [p.png]}\n  - {name: a, faces: [p.png]}\n").find("two objects"),
            std::string::npos);
  EXPECT_NE(ErrorOf([&] { LoadWorldParams(folder_ / "none.yaml"); }).find("none.yaml"), std::string::npos);
}

TEST_F(SmallWorld, MeshesTakeTheObjectsPlaces) {
  const std::string obj = "v 0.3 0 1\nv 0.4 0 1\nv 0.3 0.1 1\nv 0.3 0 1.2\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
  const WorldParams params = WorldWithMeshes(params_, {Write("a.obj", obj), Write("textured.obj", obj), Write("b.obj", obj)});
  ASSERT_EQ(params.objects.size(), 3u);
  EXPECT_EQ(params.objects[0].name, "a");
  EXPECT_EQ(params.objects[1].name, folder_.filename().string());
  const std::vector<TrueObject> truth = SimulatedWorld(params).Truth();
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const Eigen::Matrix3Xd points = truth[i].T_world_object * truth[i].points;
    EXPECT_NEAR(points.row(2).minCoeff(), 0.0, 0.005);
    const double aside_m = points.topRows(2).rowwise().mean().norm();
    EXPECT_NEAR(aside_m, i == 0 ? 0.0 : 0.27, 0.05);
  }
  EXPECT_THROW(WorldWithMeshes(params_, {folder_ / "gone.obj"}), std::runtime_error);
}

// --- The shipped worlds -----------------------------------------------------------------------------------------------

TEST(Worlds, EveryShippedWorldLoadsAndShowsItsObjects) {
  int count = 0;
  for (const auto& entry : fs::directory_iterator(kWorlds)) {
    SCOPED_TRACE(entry.path().string());
    const SimulatedWorld world(LoadWorldParams(entry.path()));
    const cv::Mat labels = world.Labels(world.StartPose());
    for (std::size_t i = 0; i < world.Truth().size(); ++i) EXPECT_GT(cv::countNonZero(labels == static_cast<int>(i)), 500) << i;
    ++count;
  }
  EXPECT_GE(count, 1);
}

// The target has details enough from all round to be learned.
TEST(Worlds, TheTargetOfTheTableIsTextured) {
  const SimulatedWorld world(LoadWorldParams(kWorlds / "table.yaml"));
  const char* pictures = std::getenv("VANTAGE_TEST_PICTURES");
  for (int i = 0; i < 8; ++i) {
    const double azimuth = i * M_PI / 4, elevation = i % 2 == 0 ? 0.4 : 0.9;
    const Eigen::Vector3d eye =
        Eigen::Vector3d(0, 0, 0.1) + 0.65 * Eigen::Vector3d(std::cos(elevation) * std::cos(azimuth),
                                                            std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
    const Rigid pose = geometry::LookAt(eye, {0, 0, 0.1}, {0, 0, 1});
    const rgbd::Frame frame = world.Look(pose, static_cast<std::uint32_t>(i));
    const cv::Mat mask = world.Labels(pose) == 0;
    std::vector<cv::Point2f> points;
    cv::goodFeaturesToTrack(rgbd::Gray(frame), points, 1000, 0.05, 4.0, mask);
    EXPECT_GT(points.size(), 80u) << "from azimuth " << azimuth;
    if (pictures) {
      cv::imwrite(std::string(pictures) + "/table_" + std::to_string(i) + ".png", frame.color);
      cv::imwrite(std::string(pictures) + "/table_" + std::to_string(i) + "_depth.png", frame.depth * 100);
      std::printf("azimuth %.0f: %zu points on %d px\n", azimuth * 180 / M_PI, points.size(), cv::countNonZero(mask));
    }
  }
  if (pictures) cv::imwrite(std::string(pictures) + "/table_start.png", world.Look(world.StartPose(), 1).color);
}

TEST(Worlds, ScansStandOnTheTable) {
  VANTAGE_NEEDS_DATA("meshes");
  const fs::path meshes = testing::DataFolder() / "meshes";
  const SimulatedWorld world(
      WorldWithMeshes(LoadWorldParams(kWorlds / "table.yaml"),
                      {meshes / "003_cracker_box/textured.obj", meshes / "006_mustard_bottle/textured.obj"}));
  ASSERT_EQ(world.Truth().size(), 2u);
  EXPECT_EQ(world.Truth()[0].name, "003_cracker_box");
  const cv::Mat labels = world.Labels(world.StartPose());
  EXPECT_GT(cv::countNonZero(labels == 0), 8000);
  EXPECT_GT(cv::countNonZero(labels == 1), 2000);
  if (const char* pictures = std::getenv("VANTAGE_TEST_PICTURES"))
    cv::imwrite(std::string(pictures) + "/table_meshes.png", world.Look(world.StartPose(), 1).color);
}

}  // namespace
}  // namespace vantage::simulation
