// Textured triangle meshes.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <opencv2/core.hpp>
#include <vector>

#include "rgbd/frame.h"

namespace vantage::rendering {

struct Mesh {
  std::vector<Eigen::Vector3f> vertices;    // Mesh coordinates, metres.
  std::vector<Eigen::Vector2f> texture_uv;  // One per vertex, v up (OBJ convention); empty where colours are per vertex.
  std::vector<Eigen::Vector3f> colors;      // One per vertex, BGR in [0, 255]; empty where there is a texture.
  std::vector<Eigen::Vector3i> triangles;   // Vertex indices, counter-clockwise seen from outside.
  cv::Mat texture;                          // CV_8UC3 BGR; empty where colours are per vertex.
};

// Reads an OBJ or PLY with its texture (assimp). Throws std::runtime_error naming the file and what is wrong with it.
Mesh LoadMesh(const std::filesystem::path& file);

// A box of the given size (metres) centred at the origin; each of the six faces (+x -x +y -y +z -z) wears the whole of the image of
// the same index, upright along z (top and bottom: along y), seen from outside (indices wrap around; images are CV_8UC3 and may
// differ in size; at least one; kept at 896 x 896 pixels at most).
Mesh BoxMesh(const Eigen::Vector3d& size_m, const std::vector<cv::Mat>& faces);

// A flat rectangle in the xy plane, centred, normal +z, wearing `texture` (upright towards +y) repeated every `tile_m` metres along
// x, along y as its aspect asks.
Mesh RectangleMesh(double size_x_m, double size_y_m, const cv::Mat& texture, double tile_m);

// The surface one RGB-D frame shows where `mask` (CV_8UC1, non-zero = use; empty = everywhere) is set, as a textured mesh in
// coordinates of the frame T_target_camera maps into. Neighbouring pixels are joined where their depths differ by less than
// `max_jump_m` per pixel of step; `step_px` thins the grid; holes of up to 3 pixels on one surface are
// bridged. Empty where no depth is in the mask.
Mesh MeshFromFrame(const rgbd::Frame& frame, const cv::Mat& mask, const geometry::Rigid& T_target_camera, int step_px = 1,
                   double max_jump_m = 0.01);

// Axis-aligned bounds of the vertices.
void Bounds(const Mesh& mesh, Eigen::Vector3d* lower, Eigen::Vector3d* upper);

// `count` points spread over the surface by area (seeded), 3 x count, mesh coordinates, metres.
Eigen::Matrix3Xd SampleSurface(const Mesh& mesh, int count, std::uint32_t seed);

}  // namespace vantage::rendering
