// What verbs ask of a recording beside its frames: which object is meant, and how the camera moved.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rgbd/bop.h"

namespace vantage::cli {

// The ids `selection` names. Throws std::runtime_error where none is left or the text is wrong.
std::vector<int> FramesOf(const rgbd::BopScene& scene, const std::string& selection);

// The folder's own name, also for "." and "a/b/".
std::string NameOfFolder(const std::string& folder);

// True pose of the object, mesh coordinates to camera; nullopt where the truth does not list it.
std::optional<geometry::Rigid> TruthOf(const rgbd::BopScene& scene, int id, int object_id);

// What a recording says of where a frame was taken.
struct KnownPose {
  std::optional<geometry::Rigid> T_camera_mesh;   // True pose of the object meant.
  std::optional<geometry::Rigid> T_world_camera;  // The camera's.
  bool known() const { return T_camera_mesh || T_world_camera; }
};
KnownPose KnownPoseOf(const rgbd::BopScene& scene, const rgbd::Frame& frame, std::optional<int> object_id);

// T_to_from: maps camera coordinates of frame `from` to those of frame `to`; by the object's true poses where both are known, else
// by the camera's. nullopt where the recording does not know.
std::optional<geometry::Rigid> MotionBetween(const KnownPose& from, const KnownPose& to);

// The value the object's pixels have in the label images: the one most often under its projected origin. nullopt where there are
// no label images. Throws std::runtime_error where the recording's truth never lists the object.
std::optional<int> LabelOfObject(const rgbd::BopScene& scene, int object_id);

// A pixel well inside the object: of its label's pixels the one farthest from the others; without labels its projected origin.
// nullopt where the object is not in the image.
std::optional<Eigen::Vector2d> PixelOfObject(const rgbd::BopScene& scene, int id, int object_id, std::optional<int> label);

}  // namespace vantage::cli
