#include "rendering/exposure.h"

#include <algorithm>
#include <cmath>

namespace vantage::rendering {
namespace {

constexpr int kLanes = 8;
constexpr float kMostSmoothing = 0.7f;  // cos of the angle beyond which a smoothed normal is not believed (a real edge).
constexpr float kEdge = 0.9f;           // |cos| of the angle between neighbouring pixels' normals below which there is an edge.

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
      normals_(camera.height, camera.width, CV_32FC3) {
  for (const Instance& instance : instances) R_mesh_camera_.push_back(instance.R_world_mesh.transpose() * R_world_camera_);
}

// Rays have length 1 along the optical axis, so that Embree's distance is the depth.
void Exposure::Cast(const float (*pixels)[2], int count, Hit* hits) const {
  RTCRayHit8 packet;
  alignas(32) int valid[kLanes];
  for (int i = 0; i < kLanes; ++i) {
    valid[i] = i < count ? -1 : 0;
    const float* pixel = pixels[std::min(i, count - 1)];
    const Eigen::Vector3f direction =
        R_world_camera_ * Eigen::Vector3f((pixel[0] - static_cast<float>(camera_.cx)) / static_cast<float>(camera_.fx),
                                          (pixel[1] - static_cast<float>(camera_.cy)) / static_cast<float>(camera_.fy), 1.0f);
    packet.ray.org_x[i] = eye_in_world_.x();
    packet.ray.org_y[i] = eye_in_world_.y();
    packet.ray.org_z[i] = eye_in_world_.z();
    packet.ray.dir_x[i] = direction.x();
    packet.ray.dir_y[i] = direction.y();
    packet.ray.dir_z[i] = direction.z();
    packet.ray.tnear[i] = 1e-3f;
    packet.ray.tfar[i] = 1e9f;
    packet.ray.time[i] = 0.0f;
    packet.ray.mask[i] = ~0u;
    packet.ray.id[i] = static_cast<unsigned>(i);
    packet.ray.flags[i] = 0;
    packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcIntersect8(valid, scene_, &context, &packet);
  for (int i = 0; i < count; ++i) {
    hits[i].instance = packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID ? -1 : static_cast<int>(packet.hit.instID[0][i]);
    hits[i].triangle = packet.hit.primID[i];
    hits[i].depth = packet.ray.tfar[i];
    hits[i].u = packet.hit.u[i];
    hits[i].v = packet.hit.v[i];
    hits[i].normal_in_mesh = {packet.hit.Ng_x[i], packet.hit.Ng_y[i], packet.hit.Ng_z[i]};
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
  const Mesh& mesh = *instance.shape->mesh;
  const Eigen::Matrix3f& R = R_mesh_camera_[hit.instance];
  const float fx = static_cast<float>(camera_.fx), fy = static_cast<float>(camera_.fy);
  const Eigen::Vector3f ray =
      R * Eigen::Vector3f((x - static_cast<float>(camera_.cx)) / fx, (y - static_cast<float>(camera_.cy)) / fy, 1.0f);
  Eigen::Vector3f normal = hit.normal_in_mesh.normalized();
  if (normal.dot(ray) > 0.0f) normal = -normal;
  const float towards = -normal.dot(ray);
  *grazing = towards / ray.norm();

  const Eigen::Vector3i& t = mesh.triangles[hit.triangle];
  const float brightness = Brightness(instance, hit, normal);
  if (mesh.texture.empty())
    return brightness * ((1 - hit.u - hit.v) * mesh.colors[t[0]] + hit.u * mesh.colors[t[1]] + hit.v * mesh.colors[t[2]]);

  // The pixel's edges on the surface (ray differentials, Igehy 1999), then in the texture by the gradients of (u, v).
  const auto on_surface = [&](const Eigen::Vector3f& step) -> Eigen::Vector3f {
    return hit.depth * (step + ray * (normal.dot(step) / std::max(towards, 1e-4f)));
  };
  const Eigen::Vector3f across = on_surface(R.col(0) * (pixel_size / fx)), down = on_surface(R.col(1) * (pixel_size / fy));
  const Eigen::Vector3f e1 = mesh.vertices[t[1]] - mesh.vertices[t[0]], e2 = mesh.vertices[t[2]] - mesh.vertices[t[0]];
  const Eigen::Vector3f n = e1.cross(e2);
  const float scale = 1.0f / std::max(n.squaredNorm(), 1e-30f);
  const Eigen::Vector3f gradient_u = scale * e2.cross(n), gradient_v = scale * n.cross(e1);
  const Eigen::Vector2f uv0 = mesh.texture_uv[t[0]], uv1 = mesh.texture_uv[t[1]] - uv0, uv2 = mesh.texture_uv[t[2]] - uv0;
  const auto in_texture = [&](const Eigen::Vector3f& step) -> Eigen::Vector2f {
    return gradient_u.dot(step) * uv1 + gradient_v.dot(step) * uv2;
  };
  return brightness * instance.shape->texture.Sample(uv0 + hit.u * uv1 + hit.v * uv2, in_texture(across), in_texture(down));
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
        const Eigen::Vector3f normal = hits[i].normal_in_mesh.normalized();
        normals_.at<cv::Vec3f>(y, x) = {normal.x(), normal.y(), normal.z()};
        image_->depth.at<float>(y, x) = hits[i].instance < 0 ? 0.0f : hits[i].depth;
      }
    }
  }
}

// Whether the surface breaks between a pixel and its two neighbours along one axis: another instance, an edge, a jump.
bool Exposure::Breaks(int x, int y, int step_x, int step_y) const {
  const int ax = std::max(x - step_x, 0), ay = std::max(y - step_y, 0);
  const int bx = std::min(x + step_x, camera_.width - 1), by = std::min(y + step_y, camera_.height - 1);
  const int label = image_->label.at<int>(y, x);
  if (image_->label.at<int>(ay, ax) != label || image_->label.at<int>(by, bx) != label) return true;
  if (label < 0 || (ax == x && ay == y) || (bx == x && by == y)) return false;
  const cv::Vec3f& normal = normals_.at<cv::Vec3f>(y, x);
  if (std::abs(normal.dot(normals_.at<cv::Vec3f>(ay, ax))) < kEdge || std::abs(normal.dot(normals_.at<cv::Vec3f>(by, bx))) < kEdge)
    return true;
  // 1/z is linear in the image on a plane.
  const float z = image_->depth.at<float>(y, x);
  return std::abs(z / image_->depth.at<float>(ay, ax) + z / image_->depth.at<float>(by, bx) - 2.0f) > 0.01f;
}

bool Exposure::IsOutline(int x, int y) const { return Breaks(x, y, 1, 0) || Breaks(x, y, 0, 1); }

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
