// Ray-cast colour and depth images of textured meshes (Embree).
#pragma once

#include <memory>
#include <opencv2/core.hpp>

#include "geometry/camera.h"
#include "geometry/rigid.h"
#include "rendering/mesh.h"

namespace vantage::rendering {

struct Image {
  cv::Mat color;    // CV_8UC3 BGR; `background` where nothing was hit.
  cv::Mat depth;    // CV_32FC1, metres along z; 0 where nothing was hit.
  cv::Mat label;    // CV_32SC1, the instance hit; -1 where none.
  cv::Mat grazing;  // CV_32FC1, |cos| between ray and surface normal; 0 where nothing was hit.
};

struct RenderParams {
  // Rays a pixel and axis for colour where a pixel is not on one surface (outlines and edges; 2 = 4 rays, box-filtered); in
  // [1, 16]. Inside surfaces the texture filter does it with one ray, which is as smooth and much cheaper. Depth and label: one
  // ray.
  int samples_per_axis = 1;
  bool shaded = true;     // Lambert shading by one directional light plus ambient; false = texture as it is.
  double ambient = 0.55;  // Share of light from everywhere, [0, 1].
  Eigen::Vector3d light_in_world{0.3, 0.4, 1.0};  // Direction towards the light.
  cv::Scalar background{0, 0, 0};                 // BGR.
  int threads = 1;                                // Over blocks of rows; in [1, 64]. The image does not depend on it.

  void Check() const;  // Throws std::invalid_argument naming the field.
};

// A set of mesh instances. Meshes are shared; moving an instance costs no copy. Not for concurrent change; Render is const and
// may be called from several threads.
class Scene {
 public:
  Scene();
  ~Scene();
  Scene(Scene&&) noexcept;
  Scene& operator=(Scene&&) noexcept;

  // Returns the instance number, counted from 0. A mesh is kept, and prepared once however many instances it has (mip levels: 1/3
  // of its texture's memory). Throws std::invalid_argument where the mesh is malformed; one without triangles is allowed.
  int Add(std::shared_ptr<const Mesh> mesh, const geometry::Rigid& T_world_mesh);
  void Move(int instance, const geometry::Rigid& T_world_mesh);
  // Hidden instances are not seen and hide nothing.
  void SetVisible(int instance, bool visible);

  // Texture lookups are filtered (mip levels by distance and slant), so that far and slanted textures do not alias. Surfaces are
  // seen from both sides; no shadows are cast. 640 x 480 of a table scene: about 50 ms on one core.
  Image Render(const geometry::PinholeCamera& camera, const geometry::Rigid& T_world_camera, const RenderParams& params = {}) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vantage::rendering
