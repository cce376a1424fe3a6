// How far points are from a mesh's surface (Embree's point queries).
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "rendering/mesh.h"

namespace vantage::rendering {

class SurfaceDistance {
 public:
  // Builds a tree over the triangles; the mesh is not kept. Throws std::invalid_argument where the mesh has no triangles.
  explicit SurfaceDistance(const Mesh& mesh);
  ~SurfaceDistance();
  SurfaceDistance(SurfaceDistance&&) noexcept;
  SurfaceDistance& operator=(SurfaceDistance&&) noexcept;

  // Metres to the nearest point of the surface; mesh coordinates. Some microseconds.
  double operator()(const Eigen::Vector3d& point_in_mesh) const;
  // Of every column of `points_in_mesh` (3 x N, metres).
  std::vector<double> Of(const Eigen::Ref<const Eigen::Matrix3Xd>& points_in_mesh) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vantage::rendering
