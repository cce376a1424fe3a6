// One object of a recording, learned at its true poses: figures of what comes after tracking.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "features/features.h"
#include "model/object_model.h"
#include "rgbd/bop.h"

namespace vantage::cli {

// An object in a recording that has labels and truth for it.
class KnownObject {
 public:
  // Throws std::runtime_error where the recording has no labels or never lists the object. The scene must outlive this.
  KnownObject(const rgbd::BopScene& scene, int object_id);

  const rgbd::BopScene& scene() const { return scene_; }
  cv::Mat Mask(int id) const;                             // CV_8UC1, 255 on the object.
  std::optional<geometry::Rigid> TruePose(int id) const;  // T_camera_mesh; nullopt where the object is not listed.
  Eigen::Matrix3Xd Surface(
      const std::vector<int>& ids) const;  // Points of all these frames' depth on it, mesh coordinates, metres.

  // A model with a view of every one of these frames that shows enough of the object. Its frame is the mesh's, moved by
  // T_mesh_object.
  model::ObjectModel Learn(const std::vector<int>& ids, const features::FeatureParams& params,
                           const geometry::Rigid& T_mesh_object = geometry::Rigid::Identity()) const;

 private:
  const rgbd::BopScene& scene_;
  int object_id_;
  int label_;
};

}  // namespace vantage::cli
