#include "rendering/exposure.h"

#include <algorithm>
#include <cmath>

namespace vantage::rendering {
namespace {

constexpr int kLanes = 8;
constexpr float kMostSmoothing = 0.7f;  // cos of the angle beyond which a smoothed normal is not believed (a real edge).
constexpr int kEdge = 14500;            // Normals of length 127: the cosine, 0.9, below which there is an edge between neighbours.

cv::Vec3b ToPixel(const Eigen::Vector3f& color) {
  return {cv::saturate_cast<std::uint8_t>(color[0]), cv::saturate_cast<std::uint8_t>(color[1]),
          cv::saturate_cast<std::uint8_t>(color[2])};
}

}  // namespace

Exposure::Exposure(RTCScene scene, const std::vector<Instance>& instances, const geometry::PinholeCamera& camera,
                   const geometry::Rigid& T_world_camera, const RenderParams& params, Image* image)
    : scene_(scene),
      instances_(instances),
      camera_(camera),
      params_(params),
      image_(image),
      R_world_camera_(T_world_camera.linear().cast<float>()),
      eye_in_world_(T_world_camera.translation().cast<float>()),
      light_(params.light_in_world.normalized().cast<float>()),
      surfaces_(static_cast<std::size_t>(camera.width) * camera.height) {
  for (const Instance& instance : instances) R_mesh_camera_.push_back(instance.R_world_mesh.transpose() * R_world_camera_);
}

// Rays have length 1 along the optical axis, so that Embree's distance is the depth.
void Exposure::Cast(const float (*pixels)[2], int count, Hit* hits) const {
  RTCRayHit8 packet;
  alignas(32) int valid[kLanes];
  const float cx = static_cast<float>(camera_.cx), per_fx = 1.0f / static_cast<float>(camera_.fx);
  const float cy = static_cast<float>(camera_.cy), per_fy = 1.0f / static_cast<float>(camera_.fy);
  const Eigen::Matrix3f& R = R_world_camera_;
  alignas(32) float x[kLanes], y[kLanes];
  for (int i = 0; i < kLanes; ++i) {
    x[i] = (pixels[std::min(i, count - 1)][0] - cx) * per_fx;
    y[i] = (pixels[std::min(i, count - 1)][1] - cy) * per_fy;
  }
  for (int i = 0; i < kLanes; ++i) {
    valid[i] = i < count ? -1 : 0;
    packet.ray.org_x[i] = eye_in_world_.x();
    packet.ray.org_y[i] = eye_in_world_.y();
    packet.ray.org_z[i] = eye_in_world_.z();
    packet.ray.dir_x[i] = R(0, 0) * x[i] + R(0, 1) * y[i] + R(0, 2);
    packet.ray.dir_y[i] = R(1, 0) * x[i] + R(1, 1) * y[i] + R(1, 2);
    packet.ray.dir_z[i] = R(2, 0) * x[i] + R(2, 1) * y[i] + R(2, 2);
    packet.ray.tnear[i] = 1e-3f;
    packet.ray.tfar[i] = 1e9f;
    packet.ray.time[i] = 0.0f;
    packet.ray.mask[i] = ~0u;
    packet.ray.id[i] = static_cast<unsigned>(i);
    packet.ray.flags[i] = 0;
    packet.hit.Ng_x[i] = packet.hit.Ng_y[i] = packet.hit.Ng_z[i] = 0.0f;
    packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcIntersect8(valid, scene_, &context, &packet);
  alignas(32) float scale[kLanes];
  for (int i = 0; i < kLanes; ++i) {
    const RTCHit8& hit = packet.hit;
    scale[i] = 1.0f / std::sqrt(hit.Ng_x[i] * hit.Ng_x[i] + hit.Ng_y[i] * hit.Ng_y[i] + hit.Ng_z[i] * hit.Ng_z[i] + 1e-30f);
  }
  for (int i = 0; i < count; ++i) {
    hits[i].instance = packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID ? -1 : static_cast<int>(packet.hit.instID[0][i]);
    hits[i].triangle = packet.hit.primID[i];
    hits[i].depth = packet.ray.tfar[i];
    hits[i].u = packet.hit.u[i];
    hits[i].v = packet.hit.v[i];
    hits[i].normal_in_mesh = {scale[i] * packet.hit.Ng_x[i], scale[i] * packet.hit.Ng_y[i], scale[i] * packet.hit.Ng_z[i]};
  }
}

float Exposure::Brightness(const Instance& instance, const Hit& hit, const Eigen::Vector3f& normal_in_mesh) const {
  if (!params_.shaded) return 1.0f;
  const Shape& shape = *instance.shape;
  Eigen::Vector3f normal = normal_in_mesh;
  if (!shape.normals.empty()) {
    const Eigen::Vector3i& t = shape.mesh->triangles[hit.triangle];
    Eigen::Vector3f smooth = (1 - hit.u - hit.v) * shape.normals[t[0]] + hit.u * shape.normals[t[1]] + hit.v * shape.normals[t[2]];
    smooth.normalize();
    if (smooth.dot(normal_in_mesh) < 0.0f) smooth = -smooth;  // Seen from behind.
    if (smooth.dot(normal_in_mesh) > kMostSmoothing) normal = smooth;
  }
  const float ambient = static_cast<float>(params_.ambient);
  return ambient + (1.0f - ambient) * std::max(0.0f, light_.dot(instance.R_world_mesh * normal));
}

// Colour of what was hit by the ray through pixel (x, y); `pixel_size` is the edge of the pixel's share that this ray stands for.
Eigen::Vector3f Exposure::Shade(const Hit& hit, float x, float y, float pixel_size, float* grazing) const {
  if (hit.instance < 0) {
    *grazing = 0.0f;
    const cv::Scalar& b = params_.background;
    return {static_cast<float>(b[0]), static_cast<float>(b[1]), static_cast<float>(b[2])};
  }
  const Instance& instance = instances_[hit.instance];
  const Eigen::Matrix3f& R = R_mesh_camera_[hit.instance];
  const float fx = static_cast<float>(camera_.fx), fy = static_cast<float>(camera_.fy);
  const Eigen::Vector3f ray =
      R * Eigen::Vector3f((x - static_cast<float>(camera_.cx)) / fx, (y - static_cast<float>(camera_.cy)) / fy, 1.0f);
  Eigen::Vector3f normal = hit.normal_in_mesh;
  if (normal.dot(ray) > 0.0f) normal = -normal;
  const float towards = -normal.dot(ray);
  *grazing = towards / ray.norm();

  const float brightness = Brightness(instance, hit, normal);
  const Mesh& mesh = *instance.shape->mesh;
  if (mesh.texture.empty()) {
    const Eigen::Vector3i& t = mesh.triangles[hit.triangle];
    return brightness * ((1 - hit.u - hit.v) * mesh.colors[t[0]] + hit.u * mesh.colors[t[1]] + hit.v * mesh.colors[t[2]]);
  }

  // The pixel's edges on the surface (ray differentials, Igehy 1999), then in the texture by the gradients of (u, v).
  const float slant = 1.0f / std::max(towards, 1e-4f);
  const auto on_surface = [&](const Eigen::Vector3f& step) -> Eigen::Vector3f {
    return hit.depth * (step + ray * (normal.dot(step) * slant));
  };
  const Eigen::Vector3f across = on_surface(R.col(0) * (pixel_size / fx)), down = on_surface(R.col(1) * (pixel_size / fy));
  const Facet& facet = instance.shape->facets[hit.triangle];
  return brightness * instance.shape->texture.Sample(facet.uv0 + hit.u * facet.uv1 + hit.v * facet.uv2, facet.uv_per_m * across,
                                                     facet.uv_per_m * down);
}

void Exposure::FirstRays(int row_begin, int row_end) {
  for (int y0 = row_begin; y0 < row_end; y0 += 2) {
    for (int x0 = 0; x0 < camera_.width; x0 += 4) {
      float pixels[kLanes][2];
      int count = 0;
      for (int y = y0; y < std::min(y0 + 2, row_end); ++y) {
        for (int x = x0; x < std::min(x0 + 4, camera_.width); ++x, ++count) {
          pixels[count][0] = static_cast<float>(x);
          pixels[count][1] = static_cast<float>(y);
        }
      }
      Hit hits[kLanes];
      Cast(pixels, count, hits);
      for (int i = 0; i < count; ++i) {
        const int x = static_cast<int>(pixels[i][0]), y = static_cast<int>(pixels[i][1]);
        float grazing = 0.0f;
        image_->color.at<cv::Vec3b>(y, x) = ToPixel(Shade(hits[i], pixels[i][0], pixels[i][1], 1.0f, &grazing));
        image_->grazing.at<float>(y, x) = grazing;
        image_->label.at<int>(y, x) = hits[i].instance;
        image_->depth.at<float>(y, x) = hits[i].instance < 0 ? 0.0f : hits[i].depth;
        surfaces_[static_cast<std::size_t>(y) * camera_.width + x] = SurfaceOf(hits[i]);
      }
    }
  }
}

Exposure::Surface Exposure::SurfaceOf(const Hit& hit) {
  if (hit.instance < 0) return {-1, 0.0f, {0, 0, 0}};
  const Eigen::Vector3f normal = 127.0f * hit.normal_in_mesh;
  return {hit.instance,
          1.0f / hit.depth,
          {static_cast<std::int8_t>(normal.x()), static_cast<std::int8_t>(normal.y()), static_cast<std::int8_t>(normal.z())}};
}

// Whether the surface breaks at a pixel between two neighbours: another instance, an edge, a jump in depth.
bool Exposure::Breaks(const Surface& before, const Surface& here, const Surface& after) {
  if (before.instance != here.instance || after.instance != here.instance) return true;
  if (here.instance < 0) return false;
  // 1/z is linear in the image on a plane.
  if (std::abs(before.inverse_depth + after.inverse_depth - 2.0f * here.inverse_depth) > 0.01f * here.inverse_depth) return true;
  const auto cosine = [](const Surface& a, const Surface& b) {
    return std::abs(a.normal[0] * b.normal[0] + a.normal[1] * b.normal[1] + a.normal[2] * b.normal[2]);
  };
  return cosine(before, here) < kEdge || cosine(after, here) < kEdge;
}

bool Exposure::IsOutline(int x, int y) const {
  const Surface* here = &surfaces_[static_cast<std::size_t>(y) * camera_.width + x];
  const int left = x > 0 ? 1 : 0, right = x + 1 < camera_.width ? 1 : 0;
  const int above = y > 0 ? camera_.width : 0, below = y + 1 < camera_.height ? camera_.width : 0;
  // At the image's border a neighbour is missing, and 1/z tells nothing.
  const Surface& up = below ? here[-above] : *here;
  const Surface& down = above ? here[below] : *here;
  return Breaks(right ? here[-left] : *here, *here, left ? here[right] : *here) || Breaks(up, *here, down);
}

void Exposure::SmoothOutlines(int row_begin, int row_end) {
  const int n = params_.samples_per_axis, samples = n * n;
  const float share = 1.0f / static_cast<float>(n);
  for (int y = row_begin; y < row_end; ++y) {
    for (int x = 0; x < camera_.width; ++x) {
      if (!IsOutline(x, y)) continue;
      Eigen::Vector3f sum = Eigen::Vector3f::Zero();
      for (int first = 0; first < samples; first += kLanes) {
        const int count = std::min(kLanes, samples - first);
        float pixels[kLanes][2];
        for (int i = 0; i < count; ++i) {
          pixels[i][0] = static_cast<float>(x) - 0.5f + (static_cast<float>((first + i) % n) + 0.5f) * share;
          pixels[i][1] = static_cast<float>(y) - 0.5f + (static_cast<float>((first + i) / n) + 0.5f) * share;
        }
        Hit hits[kLanes];
        Cast(pixels, count, hits);
        float grazing = 0.0f;
        for (int i = 0; i < count; ++i) sum += Shade(hits[i], pixels[i][0], pixels[i][1], share, &grazing);
      }
      image_->color.at<cv::Vec3b>(y, x) = ToPixel(sum / static_cast<float>(samples));
    }
  }
}

}  // namespace vantage::rendering
