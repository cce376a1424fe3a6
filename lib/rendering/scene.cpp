#include "rendering/scene.h"

#include <algorithm>
#include <map>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "rendering/exposure.h"

namespace vantage::rendering {
namespace {

void CheckMesh(const Mesh& mesh) {
  const auto fail = [](const std::string& what) { throw std::invalid_argument("Scene::Add: " + what); };
  const bool textured = !mesh.texture.empty();
  if (textured && (mesh.texture.type() != CV_8UC3 || mesh.texture_uv.size() != mesh.vertices.size()))
    fail("a textured mesh needs a CV_8UC3 texture and one texture coordinate per vertex");
  if (!textured && mesh.colors.size() != mesh.vertices.size()) fail("a mesh without texture needs one colour per vertex");
  const int count = static_cast<int>(mesh.vertices.size());
  for (const Eigen::Vector3i& t : mesh.triangles) {
    if (t.minCoeff() < 0 || t.maxCoeff() >= count) fail("a triangle names a vertex that does not exist");
  }
}

std::vector<Eigen::Vector3f> VertexNormals(const Mesh& mesh) {
  std::vector<Eigen::Vector3f> normals(mesh.vertices.size(), Eigen::Vector3f::Zero());
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Eigen::Vector3f& a = mesh.vertices[t[0]];
    const Eigen::Vector3f area = (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a);
    for (int corner : {t[0], t[1], t[2]}) normals[corner] += area;
  }
  for (Eigen::Vector3f& normal : normals) normal.normalize();
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Eigen::Vector3f& a = mesh.vertices[t[0]];
    const Eigen::Vector3f face = (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a).normalized();
    for (int corner : {t[0], t[1], t[2]}) {
      if (normals[corner].dot(face) < 0.9999f) return normals;
    }
  }
  return {};
}

Facet FacetOf(const Mesh& mesh, const Eigen::Vector3i& t) {
  const Eigen::Vector3f e1 = mesh.vertices[t[1]] - mesh.vertices[t[0]], e2 = mesh.vertices[t[2]] - mesh.vertices[t[0]];
  const Eigen::Vector3f n = e1.cross(e2);
  const float scale = 1.0f / std::max(n.squaredNorm(), 1e-30f);
  Facet facet;
  facet.uv0 = mesh.texture_uv[t[0]];
  facet.uv1 = mesh.texture_uv[t[1]] - facet.uv0;
  facet.uv2 = mesh.texture_uv[t[2]] - facet.uv0;
  // The barycentric coordinates' gradients are e2 x n and n x e1 over |n|^2.
  facet.uv_per_m = facet.uv1 * (scale * e2.cross(n)).transpose() + facet.uv2 * (scale * n.cross(e1)).transpose();
  return facet;
}

}  // namespace

Shape::Shape(RTCDevice device, std::shared_ptr<const Mesh> source) : mesh(std::move(source)) {
  CheckMesh(*mesh);
  if (!mesh->texture.empty()) {
    texture = MipTexture(mesh->texture);
    facets.reserve(mesh->triangles.size());
    for (const Eigen::Vector3i& t : mesh->triangles) facets.push_back(FacetOf(*mesh, t));
  }
  normals = VertexNormals(*mesh);
  scene = rtcNewScene(device);
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);  // No light leaks between the triangles of a fine depth mesh.
  if (!mesh->triangles.empty()) {
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), mesh->vertices.size()));
    auto* indices = static_cast<unsigned*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                                   3 * sizeof(unsigned), mesh->triangles.size()));
    for (const Eigen::Vector3f& v : mesh->vertices) vertices = std::copy_n(v.data(), 3, vertices);
    for (const Eigen::Vector3i& t : mesh->triangles) indices = std::copy_n(t.data(), 3, indices);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(scene);
}

namespace {

void SetTransform(RTCGeometry geometry, const geometry::Rigid& T) {
  const Eigen::Matrix4f matrix = T.matrix().cast<float>();
  rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR, matrix.data());
  rtcCommitGeometry(geometry);
}

// Runs `work(row_begin, row_end)` over blocks of rows; blocks do not share pixels, so the number of threads changes nothing.
template <typename Work>
void OverRows(int rows, int threads, const Work& work) {
  std::vector<std::thread> helpers;
  const int block = ((rows + threads - 1) / threads + 1) / 2 * 2;
  for (int begin = block; begin < rows; begin += block)
    helpers.emplace_back([&work, begin, end = std::min(begin + block, rows)] { work(begin, end); });
  work(0, std::min(block, rows));
  for (std::thread& helper : helpers) helper.join();
}

}  // namespace

void RenderParams::Check() const {
  const auto require = [](bool ok, const std::string& what) {
    if (!ok) throw std::invalid_argument("RenderParams: " + what);
  };
  require(samples_per_axis >= 1 && samples_per_axis <= 16, "samples_per_axis must be in [1, 16]");
  require(ambient >= 0.0 && ambient <= 1.0, "ambient must be in [0, 1]");
  require(light_in_world.allFinite() && light_in_world.norm() > 1e-9, "light_in_world must not be zero");
  require(threads >= 1 && threads <= 64, "threads must be in [1, 64]");
}

struct Scene::Impl {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  std::vector<Instance> instances;
  std::map<const Mesh*, std::weak_ptr<const Shape>> shapes;

  Impl() {
    device = rtcNewDevice(nullptr);
    if (!device) throw std::runtime_error("Embree: cannot create a device, error " + std::to_string(rtcGetDeviceError(nullptr)));
    scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_DYNAMIC);
    rtcCommitScene(scene);
  }
  ~Impl() {
    for (Instance& instance : instances) rtcReleaseGeometry(instance.geometry);
    rtcReleaseScene(scene);
    instances.clear();
    rtcReleaseDevice(device);
  }

  void CheckInstance(int instance) const {
    if (instance < 0 || instance >= static_cast<int>(instances.size()))
      throw std::out_of_range("Scene: there is no instance " + std::to_string(instance));
  }
};

Scene::Scene() : impl_(std::make_unique<Impl>()) {}
Scene::~Scene() = default;
Scene::Scene(Scene&&) noexcept = default;
Scene& Scene::operator=(Scene&&) noexcept = default;

int Scene::Add(std::shared_ptr<const Mesh> mesh, const geometry::Rigid& T_world_mesh) {
  std::weak_ptr<const Shape>& known = impl_->shapes[mesh.get()];
  Instance instance;
  instance.shape = known.lock();
  if (!instance.shape) known = instance.shape = std::make_shared<Shape>(impl_->device, std::move(mesh));
  instance.geometry = rtcNewGeometry(impl_->device, RTC_GEOMETRY_TYPE_INSTANCE);
  instance.R_world_mesh = T_world_mesh.linear().cast<float>();
  rtcSetGeometryInstancedScene(instance.geometry, instance.shape->scene);
  rtcSetGeometryTimeStepCount(instance.geometry, 1);
  SetTransform(instance.geometry, T_world_mesh);
  const int number = static_cast<int>(impl_->instances.size());
  rtcAttachGeometryByID(impl_->scene, instance.geometry, static_cast<unsigned>(number));
  impl_->instances.push_back(std::move(instance));
  rtcCommitScene(impl_->scene);
  return number;
}

void Scene::Move(int instance, const geometry::Rigid& T_world_mesh) {
  impl_->CheckInstance(instance);
  impl_->instances[instance].R_world_mesh = T_world_mesh.linear().cast<float>();
  SetTransform(impl_->instances[instance].geometry, T_world_mesh);
  rtcCommitScene(impl_->scene);
}

void Scene::SetVisible(int instance, bool visible) {
  impl_->CheckInstance(instance);
  RTCGeometry geometry = impl_->instances[instance].geometry;
  visible ? rtcEnableGeometry(geometry) : rtcDisableGeometry(geometry);
  rtcCommitScene(impl_->scene);
}

Image Scene::Render(const geometry::PinholeCamera& camera, const geometry::Rigid& T_world_camera,
                    const RenderParams& params) const {
  camera.Check();
  params.Check();
  Image image;
  image.color.create(camera.height, camera.width, CV_8UC3);
  image.depth.create(camera.height, camera.width, CV_32FC1);
  image.label.create(camera.height, camera.width, CV_32SC1);
  image.grazing.create(camera.height, camera.width, CV_32FC1);
  Exposure exposure(impl_->scene, impl_->instances, camera, T_world_camera, params, &image);
  OverRows(camera.height, params.threads, [&](int begin, int end) { exposure.FirstRays(begin, end); });
  if (params.samples_per_axis > 1)
    OverRows(camera.height, params.threads, [&](int begin, int end) { exposure.SmoothOutlines(begin, end); });
  return image;
}

}  // namespace vantage::rendering
