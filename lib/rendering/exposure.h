// Casts the rays of one picture and shades what they hit. Internal to rendering.
#pragma once

#include <embree3/rtcore.h>

#include <memory>
#include <vector>

#include "rendering/mip_texture.h"
#include "rendering/scene.h"

namespace vantage::rendering {

// Where a triangle is in the texture: all that shading reads, in one cache line.
struct Facet {
  Eigen::Vector2f uv0, uv1, uv2;        // Of the first corner; of the others relative to it.
  Eigen::Matrix<float, 2, 3> uv_per_m;  // How (u, v) change along the surface, by steps in mesh coordinates.
};

// What one mesh needs, shared by its instances.
struct Shape {
  std::shared_ptr<const Mesh> mesh;
  MipTexture texture;
  std::vector<Eigen::Vector3f> normals;  // One per vertex, mean over its triangles by area; empty where all faces are flat.
  std::vector<Facet> facets;             // One per triangle; empty where there is no texture.
  RTCScene scene = nullptr;

  Shape(RTCDevice device, std::shared_ptr<const Mesh> source);
  ~Shape() { rtcReleaseScene(scene); }
  Shape(const Shape&) = delete;
  Shape& operator=(const Shape&) = delete;
};

struct Instance {
  std::shared_ptr<const Shape> shape;
  RTCGeometry geometry = nullptr;
  Eigen::Matrix3f R_world_mesh;
};

// One picture being taken: what all its rays share. The scene, the instances, the parameters and the image must outlive it.
class Exposure {
 public:
  Exposure(RTCScene scene, const std::vector<Instance>& instances, const geometry::PinholeCamera& camera,
           const geometry::Rigid& T_world_camera, const RenderParams& params, Image* image);

  void FirstRays(int row_begin, int row_end);       // One ray a pixel: depth, label, grazing and colour.
  void SmoothOutlines(int row_begin, int row_end);  // More rays where a pixel is not on one surface; needs all first rays.

 private:
  struct Hit {
    int instance = -1;
    unsigned triangle = 0;
    float depth = 0, u = 0, v = 0;
    Eigen::Vector3f normal_in_mesh;  // Unit length.
  };
  struct Surface {  // What a first ray hit, as small as it can be.
    int instance;
    float inverse_depth;
    std::int8_t normal[3];  // In the mesh's coordinates, length 127.
  };
  void Cast(const float (*pixels)[2], int count, Hit* hits) const;
  Eigen::Vector3f Shade(const Hit& hit, float x, float y, float pixel_size, float* grazing) const;
  float Brightness(const Instance& instance, const Hit& hit, const Eigen::Vector3f& normal_in_mesh) const;
  static Surface SurfaceOf(const Hit& hit);
  bool IsOutline(int x, int y) const;
  static bool Breaks(const Surface& before, const Surface& here, const Surface& after);

  RTCScene scene_;
  const std::vector<Instance>& instances_;
  geometry::PinholeCamera camera_;
  const RenderParams& params_;
  Image* image_;
  Eigen::Matrix3f R_world_camera_;
  Eigen::Vector3f eye_in_world_;
  Eigen::Vector3f light_;
  std::vector<Eigen::Matrix3f> R_mesh_camera_;  // Per instance.
  std::vector<Surface> surfaces_;               // Row-major.
};

}  // namespace vantage::rendering
