#include "rendering/mesh.h"

#include <algorithm>
#include <assimp/Importer.hpp>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <stdexcept>
#include <string>

#include <assimp/postprocess.h>
#include <assimp/scene.h>

namespace vantage::rendering {
namespace {

[[noreturn]] void Fail(const std::filesystem::path& file, const std::string& what) {
  throw std::runtime_error(file.string() + ": " + what);
}

// The name of the diffuse texture of a material; empty where there is none.
std::string TextureName(const aiMaterial& material) {
  for (aiTextureType type : {aiTextureType_DIFFUSE, aiTextureType_BASE_COLOR, aiTextureType_AMBIENT}) {
    aiString name;
    if (material.GetTextureCount(type) > 0 && material.GetTexture(type, 0, &name) == AI_SUCCESS) return name.C_Str();
  }
  return {};
}

// The one texture all parts of a mesh share; empty where no part has one.
std::string CommonTexture(const std::filesystem::path& file, const aiScene& scene) {
  std::string common;
  for (unsigned i = 0; i < scene.mNumMeshes; ++i) {
    const std::string name = TextureName(*scene.mMaterials[scene.mMeshes[i]->mMaterialIndex]);
    if (i > 0 && name != common) Fail(file, "its parts wear different textures; bake them into one image");
    if (!name.empty() && !scene.mMeshes[i]->HasTextureCoords(0)) Fail(file, "it names a texture but has no texture coordinates");
    common = name;
  }
  return common;
}

cv::Mat LoadTexture(const std::filesystem::path& mesh_file, std::string name) {
  name.erase(name.find_last_not_of(" \t\r\n") + 1);  // Some exporters leave blanks at the end of the line.
  if (name.empty()) Fail(mesh_file, "its material names a texture without a name");
  if (name[0] == '*') Fail(mesh_file, "textures embedded in the file are not supported; store the image beside it");
  std::replace(name.begin(), name.end(), '\\', '/');
  const std::filesystem::path file = mesh_file.parent_path() / name;
  if (!std::filesystem::exists(file)) Fail(mesh_file, "its texture " + file.string() + " does not exist");
  const cv::Mat texture = cv::imread(file.string(), cv::IMREAD_COLOR);
  if (texture.empty()) Fail(mesh_file, "its texture " + file.string() + " is not an image");
  return texture;
}

Eigen::Vector3f VertexColor(const aiScene& scene, const aiMesh& part, unsigned vertex) {
  aiColor4D color(0.7f, 0.7f, 0.7f, 1.0f);
  if (part.HasVertexColors(0)) {
    color = part.mColors[0][vertex];
  } else {
    scene.mMaterials[part.mMaterialIndex]->Get(AI_MATKEY_COLOR_DIFFUSE, color);
  }
  return 255.0f * Eigen::Vector3f(color.b, color.g, color.r);
}

void AppendPart(const aiScene& scene, const aiMesh& part, bool textured, Mesh* mesh) {
  const int first = static_cast<int>(mesh->vertices.size());
  for (unsigned i = 0; i < part.mNumVertices; ++i) {
    mesh->vertices.emplace_back(part.mVertices[i].x, part.mVertices[i].y, part.mVertices[i].z);
    if (textured) {
      mesh->texture_uv.emplace_back(part.mTextureCoords[0][i].x, part.mTextureCoords[0][i].y);
    } else {
      mesh->colors.push_back(VertexColor(scene, part, i));
    }
  }
  for (unsigned i = 0; i < part.mNumFaces; ++i) {
    const aiFace& face = part.mFaces[i];
    if (face.mNumIndices != 3) continue;  // Points and lines have no surface.
    mesh->triangles.emplace_back(first + static_cast<int>(face.mIndices[0]), first + static_cast<int>(face.mIndices[1]),
                                 first + static_cast<int>(face.mIndices[2]));
  }
}

// A rectangle at `centre` with its texture upright: `right` and `up` are half edges, `uv` its place in the texture (u to the right,
// v up).
void AppendRectangle(const Eigen::Vector3f& centre, const Eigen::Vector3f& right, const Eigen::Vector3f& up, const cv::Rect2f& uv,
                     Mesh* mesh) {
  const int first = static_cast<int>(mesh->vertices.size());
  for (const auto& [x, y] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}) {
    mesh->vertices.push_back(centre + static_cast<float>(x) * right + static_cast<float>(y) * up);
    mesh->texture_uv.emplace_back(x < 0 ? uv.x : uv.x + uv.width, y < 0 ? uv.y : uv.y + uv.height);
  }
  mesh->triangles.emplace_back(first, first + 1, first + 2);
  mesh->triangles.emplace_back(first, first + 2, first + 3);
}

void RequireImage(const cv::Mat& image, const char* where) {
  if (image.empty() || image.type() != CV_8UC3)
    throw std::invalid_argument(std::string(where) + ": images must be CV_8UC3, not empty");
}

// Side of one square cell of a box's texture: a power of two, so that cells stay apart in all mip levels that matter.
int AtlasCell(const std::vector<cv::Mat>& faces) {
  int largest = 64;
  for (const cv::Mat& face : faces) largest = std::max({largest, face.cols, face.rows});
  int cell = 64;
  while (cell < largest && cell < 1024) cell *= 2;
  return cell;
}

}  // namespace

Mesh LoadMesh(const std::filesystem::path& file) {
  if (!std::filesystem::is_regular_file(file)) Fail(file, "no such mesh file");
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile(file.string(), aiProcess_Triangulate | aiProcess_JoinIdenticalVertices |
                                                              aiProcess_PreTransformVertices | aiProcess_SortByPType);
  if (!scene || scene->mNumMeshes == 0) Fail(file, std::string("not a readable mesh (OBJ or PLY): ") + importer.GetErrorString());
  Mesh mesh;
  const std::string texture = CommonTexture(file, *scene);
  if (!texture.empty()) mesh.texture = LoadTexture(file, texture);
  for (unsigned i = 0; i < scene->mNumMeshes; ++i) AppendPart(*scene, *scene->mMeshes[i], !texture.empty(), &mesh);
  if (mesh.triangles.empty()) Fail(file, "the mesh has no triangles");
  for (const Eigen::Vector3f& vertex : mesh.vertices) {
    if (!vertex.allFinite()) Fail(file, "the mesh has vertices that are not finite");
  }
  return mesh;
}

Mesh BoxMesh(const Eigen::Vector3d& size_m, const std::vector<cv::Mat>& faces) {
  if (!(size_m.minCoeff() > 0.0)) throw std::invalid_argument("BoxMesh: every edge must be > 0 m");
  if (faces.empty()) throw std::invalid_argument("BoxMesh: at least one image is needed");
  for (const cv::Mat& face : faces) RequireImage(face, "BoxMesh");
  const int cell = AtlasCell(faces);
  const int border = cell / 16;  // Every picture's rim is repeated around it, so that filtering does not mix neighbours.
  const int inner = cell - 2 * border;
  Mesh mesh;
  mesh.texture.create(2 * cell, 3 * cell, CV_8UC3);
  const Eigen::Vector3f half = 0.5f * size_m.cast<float>();
  for (int i = 0; i < 6; ++i) {
    const cv::Point corner((i % 3) * cell, (i / 3) * cell);
    const cv::Mat& image = faces[i % faces.size()];
    cv::Mat picture;
    cv::resize(image, picture, cv::Size(inner, inner), 0, 0,
               image.cols > inner || image.rows > inner ? cv::INTER_AREA : cv::INTER_CUBIC);
    cv::copyMakeBorder(picture, mesh.texture(cv::Rect(corner, cv::Size(cell, cell))), border, border, border, border,
                       cv::BORDER_REPLICATE);
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();
    normal[i / 2] = i % 2 == 0 ? 1.0f : -1.0f;
    const Eigen::Vector3f up = i < 4 ? Eigen::Vector3f::UnitZ() : Eigen::Vector3f::UnitY();
    const Eigen::Vector3f right = up.cross(normal);
    const cv::Rect2f uv(static_cast<float>(corner.x + border) / mesh.texture.cols,
                        1.0f - static_cast<float>(corner.y + border + inner) / mesh.texture.rows,
                        static_cast<float>(inner) / mesh.texture.cols, static_cast<float>(inner) / mesh.texture.rows);
    AppendRectangle(normal.cwiseProduct(half), right.cwiseProduct(half), up.cwiseProduct(half), uv, &mesh);
  }
  return mesh;
}

Mesh RectangleMesh(double size_x_m, double size_y_m, const cv::Mat& texture, double tile_m) {
  RequireImage(texture, "RectangleMesh");
  if (!(size_x_m > 0.0 && size_y_m > 0.0 && tile_m > 0.0)) throw std::invalid_argument("RectangleMesh: sizes must be > 0 m");
  Mesh mesh;
  mesh.texture = texture;
  const double tile_y_m = tile_m * texture.rows / texture.cols;
  AppendRectangle(Eigen::Vector3f::Zero(), {static_cast<float>(size_x_m / 2), 0, 0}, {0, static_cast<float>(size_y_m / 2), 0},
                  cv::Rect2f(0, 0, static_cast<float>(size_x_m / tile_m), static_cast<float>(size_y_m / tile_y_m)), &mesh);
  return mesh;
}

void Bounds(const Mesh& mesh, Eigen::Vector3d* lower, Eigen::Vector3d* upper) {
  if (mesh.vertices.empty()) throw std::invalid_argument("Bounds: the mesh has no vertices");
  Eigen::Vector3f low = mesh.vertices.front(), high = low;
  for (const Eigen::Vector3f& vertex : mesh.vertices) {
    low = low.cwiseMin(vertex);
    high = high.cwiseMax(vertex);
  }
  *lower = low.cast<double>();
  *upper = high.cast<double>();
}

Eigen::Matrix3Xd SampleSurface(const Mesh& mesh, int count, std::uint32_t seed) {
  if (mesh.triangles.empty()) throw std::invalid_argument("SampleSurface: the mesh has no triangles");
  std::vector<double> area_up_to;
  double area = 0.0;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Eigen::Vector3f a = mesh.vertices[t[0]], b = mesh.vertices[t[1]], c = mesh.vertices[t[2]];
    area += 0.5 * static_cast<double>((b - a).cross(c - a).norm());
    area_up_to.push_back(area);
  }
  std::mt19937 random(seed);
  const auto uniform = [&random] { return random() / 4294967296.0; };
  Eigen::Matrix3Xd points(3, std::max(count, 0));
  for (int i = 0; i < points.cols(); ++i) {
    const auto chosen = std::upper_bound(area_up_to.begin(), area_up_to.end(), uniform() * area);
    const auto index = std::min<std::size_t>(chosen - area_up_to.begin(), mesh.triangles.size() - 1);
    double s = uniform(), t = uniform();
    if (s + t > 1.0) {
      s = 1.0 - s;
      t = 1.0 - t;
    }
    const Eigen::Vector3i& corners = mesh.triangles[index];
    const Eigen::Vector3d a = mesh.vertices[corners[0]].cast<double>();
    points.col(i) = a + s * (mesh.vertices[corners[1]].cast<double>() - a) + t * (mesh.vertices[corners[2]].cast<double>() - a);
  }
  return points;
}

}  // namespace vantage::rendering
