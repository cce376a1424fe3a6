#include "rendering/mesh.h"

#include <gtest/gtest.h>

#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "support/data.h"

namespace vantage::rendering {
namespace {

class MeshFiles : public ::testing::Test {
 protected:
  MeshFiles() : folder_(std::filesystem::path(::testing::TempDir()) / ("meshes_" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(folder_);
  }
  ~MeshFiles() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path Write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  static std::string ErrorOf(const std::filesystem::path& file) {
    try {
      LoadMesh(file);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "no error";
  }

  std::filesystem::path folder_;
};

TEST_F(MeshFiles, TexturedObjIsRead) {
  cv::imwrite((folder_ / "t.png").string(), cv::Mat(4, 4, CV_8UC3, cv::Scalar(10, 20, 30)));
  Write("m.mtl", "newmtl a\nmap_Kd t.png  \r\n");
  const auto file = Write("m.obj",
                          "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl a\n"
                          "f 1/1 2/2 3/3 4/4\n");
  const Mesh mesh = LoadMesh(file);
  EXPECT_EQ(mesh.triangles.size(), 2u);
  ASSERT_EQ(mesh.texture_uv.size(), mesh.vertices.size());
  EXPECT_TRUE(mesh.colors.empty());
  EXPECT_EQ(mesh.texture.at<cv::Vec3b>(0, 0), cv::Vec3b(10, 20, 30));
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) EXPECT_EQ(mesh.texture_uv[i], mesh.vertices[i].head<2>());
}

TEST_F(MeshFiles, PlyWithColoursIsRead) {
  const auto file =
      Write("m.ply",
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
            "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n"
            "property list uchar int vertex_indices\nend_header\n0 0 0 255 0 0\n1 0 0 255 0 0\n0 1 0 255 0 0\n3 0 1 2\n");
  const Mesh mesh = LoadMesh(file);
  ASSERT_EQ(mesh.colors.size(), 3u);
  EXPECT_TRUE(mesh.texture.empty());
  EXPECT_LT((mesh.colors[0] - Eigen::Vector3f(0, 0, 255)).norm(), 1e-3f);
}

TEST_F(MeshFiles, ErrorsNameTheFileAndTheReason) {
  EXPECT_NE(ErrorOf(folder_ / "none.obj").find("none.obj: no such mesh file"), std::string::npos);
  EXPECT_NE(ErrorOf(Write("bad.obj", "not a mesh")).find("bad.obj: "), std::string::npos);
  Write("m.mtl", "newmtl a\nmap_Kd gone.png\n");
  const auto file = Write("m.obj", "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n");
  EXPECT_NE(ErrorOf(file).find("gone.png does not exist"), std::string::npos);
}

TEST(Mesh, YcbScanHasItsSizeAndTexture) {
  VANTAGE_NEEDS_DATA("meshes");
  const Mesh mesh = LoadMesh(testing::DataFolder() / "meshes/003_cracker_box/textured.obj");
  Eigen::Vector3d lower, upper;
  Bounds(mesh, &lower, &upper);
  EXPECT_LT((upper - lower - Eigen::Vector3d(0.07, 0.16, 0.21)).cwiseAbs().maxCoeff(), 0.01);
  EXPECT_EQ(mesh.texture.cols, 4096);
}

TEST(Mesh, SurfaceSamplesAreSpreadByArea) {
  const Mesh box = BoxMesh({0.4, 0.2, 0.1}, {cv::Mat(8, 8, CV_8UC3, cv::Scalar::all(9))});
  const Eigen::Matrix3Xd points = SampleSurface(box, 5600, 3);
  const auto on_top = (points.row(2).array() > 0.0499).count();
  EXPECT_NEAR(static_cast<double>(on_top), 5600 * 0.08 / 0.28, 150);
  for (Eigen::Index i = 0; i < points.cols(); ++i)
    EXPECT_NEAR((points.col(i).cwiseAbs().array() / Eigen::Array3d(0.2, 0.1, 0.05)).maxCoeff(), 1.0, 1e-6);
  EXPECT_EQ(points, SampleSurface(box, 5600, 3));
  EXPECT_NE(points, SampleSurface(box, 5600, 4));
}

TEST(Mesh, BadArgumentsAreRefused) {
  const cv::Mat image(8, 8, CV_8UC3, cv::Scalar::all(9));
  EXPECT_THROW(BoxMesh({0.1, 0.0, 0.1}, {image}), std::invalid_argument);
  EXPECT_THROW(BoxMesh({0.1, 0.1, 0.1}, {}), std::invalid_argument);
  EXPECT_THROW(BoxMesh({0.1, 0.1, 0.1}, {cv::Mat(8, 8, CV_8UC1)}), std::invalid_argument);
  EXPECT_THROW(RectangleMesh(1, 1, image, 0), std::invalid_argument);
}

}  // namespace
}  // namespace vantage::rendering
