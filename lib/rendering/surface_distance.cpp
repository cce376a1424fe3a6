#include "rendering/surface_distance.h"

#include <embree3/rtcore.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <stdexcept>

namespace vantage::rendering {
namespace {

// The point of the triangle nearest to p (Ericson, Real-Time Collision Detection, 5.1.5).
Eigen::Vector3f NearestOnTriangle(const Eigen::Vector3f& p, const Eigen::Vector3f& a, const Eigen::Vector3f& b,
                                  const Eigen::Vector3f& c) {
  const Eigen::Vector3f ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const float d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0.0f && d2 <= 0.0f) return a;
  const float d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0.0f && d4 <= d3) return b;
  const float d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0.0f && d5 <= d6) return c;
  const float vc = d1 * d4 - d3 * d2;
  if (vc <= 0.0f && d1 >= 0.0f && d3 <= 0.0f) return a + d1 / (d1 - d3) * ab;
  const float vb = d5 * d2 - d1 * d6;
  if (vb <= 0.0f && d2 >= 0.0f && d6 <= 0.0f) return a + d2 / (d2 - d6) * ac;
  const float va = d3 * d6 - d5 * d4;
  if (va <= 0.0f && d4 - d3 >= 0.0f && d5 - d6 >= 0.0f) return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  const float scale = 1.0f / (va + vb + vc);
  return a + vb * scale * ab + vc * scale * ac;
}

struct Query {
  const Mesh* mesh;
  float nearest_m = std::numeric_limits<float>::infinity();
};

// Called for triangles whose bounds come into the query's radius, which shrinks to the nearest found.
bool Visit(RTCPointQueryFunctionArguments* arguments) {
  Query& query = *static_cast<Query*>(arguments->userPtr);
  const Eigen::Vector3i& t = query.mesh->triangles[arguments->primID];
  const Eigen::Vector3f p(arguments->query->x, arguments->query->y, arguments->query->z);
  const auto& v = query.mesh->vertices;
  const float distance_m = (NearestOnTriangle(p, v[t[0]], v[t[1]], v[t[2]]) - p).norm();
  if (distance_m >= query.nearest_m) return false;
  query.nearest_m = arguments->query->radius = distance_m;
  return true;  // The radius changed.
}

}  // namespace

struct SurfaceDistance::Impl {
  Mesh mesh;  // Vertices and triangles only.
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;

  ~Impl() {
    if (scene) rtcReleaseScene(scene);
    if (device) rtcReleaseDevice(device);
  }
};

SurfaceDistance::SurfaceDistance(const Mesh& mesh) : impl_(std::make_unique<Impl>()) {
  if (mesh.triangles.empty()) throw std::invalid_argument("SurfaceDistance: the mesh has no triangles");
  impl_->mesh.vertices = mesh.vertices;
  impl_->mesh.triangles = mesh.triangles;
  impl_->device = rtcNewDevice(nullptr);
  if (!impl_->device)
    throw std::runtime_error("Embree: cannot create a device, error " + std::to_string(rtcGetDeviceError(nullptr)));
  impl_->scene = rtcNewScene(impl_->device);
  RTCGeometry geometry = rtcNewGeometry(impl_->device, RTC_GEOMETRY_TYPE_TRIANGLE);
  const auto fill = [&](RTCBufferType type, RTCFormat format, const auto& values) {
    void* buffer = rtcSetNewGeometryBuffer(geometry, type, 0, format, sizeof(values[0]), values.size());
    std::memcpy(buffer, values.data(), values.size() * sizeof(values[0]));
  };
  static_assert(sizeof(Eigen::Vector3f) == 12 && sizeof(Eigen::Vector3i) == 12);
  fill(RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, impl_->mesh.vertices);
  fill(RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3, impl_->mesh.triangles);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(impl_->scene, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(impl_->scene);
}

SurfaceDistance::~SurfaceDistance() = default;
SurfaceDistance::SurfaceDistance(SurfaceDistance&&) noexcept = default;
SurfaceDistance& SurfaceDistance::operator=(SurfaceDistance&&) noexcept = default;

double SurfaceDistance::operator()(const Eigen::Vector3d& point_in_mesh) const {
  Query found{&impl_->mesh};
  RTCPointQuery query;
  query.x = static_cast<float>(point_in_mesh.x());
  query.y = static_cast<float>(point_in_mesh.y());
  query.z = static_cast<float>(point_in_mesh.z());
  query.radius = std::numeric_limits<float>::infinity();
  query.time = 0.0f;
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  rtcPointQuery(impl_->scene, &query, &context, Visit, &found);
  return found.nearest_m;
}

std::vector<double> SurfaceDistance::Of(const Eigen::Ref<const Eigen::Matrix3Xd>& points_in_mesh) const {
  std::vector<double> distances;
  for (Eigen::Index i = 0; i < points_in_mesh.cols(); ++i) distances.push_back((*this)(points_in_mesh.col(i)));
  return distances;
}

}  // namespace vantage::rendering
