// Frames in which it is known where one object is: learning at true poses, for figures of what comes after tracking.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "features/features.h"
#include "model/object_model.h"
#include "rgbd/bop.h"
#include "simulation/simulated_world.h"

namespace vantage::cli {

class KnownFrames {
 public:
  virtual ~KnownFrames() = default;

  virtual std::string Where() const = 0;            // For messages.
  virtual const std::vector<int>& ids() const = 0;  // Ascending.
  virtual rgbd::Frame Load(int id) const = 0;
  virtual cv::Mat Mask(int id) const = 0;                             // CV_8UC1, 255 on the object.
  virtual int mask_error_px() const = 0;                              // The masks' outlines may be off by so much.
  virtual std::optional<geometry::Rigid> TruePose(int id) const = 0;  // T_camera_mesh; nullopt where the object is not listed.

  // Points of all these frames' depth on the object, mesh coordinates, metres. Throws std::runtime_error where there are none.
  Eigen::Matrix3Xd Surface(const std::vector<int>& ids) const;

  // A model with a view of every one of these frames that shows enough of the object. Its frame is the mesh's, moved by
  // T_mesh_object.
  model::ObjectModel Learn(const std::vector<int>& ids, const features::FeatureParams& params,
                           const geometry::Rigid& T_mesh_object = geometry::Rigid::Identity()) const;
};

// An object in a recording that has labels and truth for it.
class RecordedObject : public KnownFrames {
 public:
  // Throws std::runtime_error where the recording has no labels or never lists the object. The scene must outlive this.
  RecordedObject(const rgbd::BopScene& scene, int object_id);

  std::string Where() const override { return scene_.folder().string(); }
  const std::vector<int>& ids() const override { return scene_.ids(); }
  rgbd::Frame Load(int id) const override { return scene_.Load(id); }
  cv::Mat Mask(int id) const override;
  int mask_error_px() const override { return 3; }  // Labels are as good as the poses they were drawn at.
  std::optional<geometry::Rigid> TruePose(int id) const override;

 private:
  const rgbd::BopScene& scene_;
  int object_id_;
  int label_;
};

// The first object of a simulated world, seen from all sides at elevations of 15 to 75 degrees and three distances, with the
// sensor's errors. Ids count from 0; even and odd ones, and every other one of these, cover the sphere evenly. Before the looks of
// `carried` it is carried elsewhere on the table and turned by `turned_rad` about z: what lies about it must not help to find it
// again. Turned, it is in other light.
class SimulatedObject : public KnownFrames {
 public:
  // Throws as SimulatedWorld does. Cost: about 0.2 s a frame on one core.
  SimulatedObject(const simulation::WorldParams& params, int frames, const std::vector<int>& carried, double turned_rad,
                  std::uint32_t seed);

  std::string Where() const override { return name_; }
  const std::vector<int>& ids() const override { return ids_; }
  rgbd::Frame Load(int id) const override { return frames_.at(static_cast<std::size_t>(id)); }
  cv::Mat Mask(int id) const override { return masks_.at(static_cast<std::size_t>(id)); }
  int mask_error_px() const override { return 0; }
  std::optional<geometry::Rigid> TruePose(int id) const override;

  // The same look with the object gone. Not while another thread looks. Cost: 0.1 s.
  rgbd::Frame Without(int id);

 private:
  simulation::SimulatedWorld world_;
  std::uint32_t seed_;
  std::string name_;
  std::vector<int> ids_;
  std::vector<rgbd::Frame> frames_;
  std::vector<cv::Mat> masks_;
  std::vector<geometry::Rigid> T_world_mesh_;  // Of every look.
};

}  // namespace vantage::cli
