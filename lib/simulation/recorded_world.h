// A recording whose views can be visited: the camera can go to any recorded pose and sees its real image there.
#pragma once

#include "rgbd/bop.h"
#include "simulation/world.h"

namespace vantage::simulation {

class RecordedWorld : public World {
 public:
  // `ids`: the frames that can be visited. World frame: the recording's, turned so that z is up from the table (the recording's
  // plane z = 0 with the cameras above; a recording whose cameras are at negative z is turned over).
  // Throws std::runtime_error where a frame has no camera pose.
  RecordedWorld(std::shared_ptr<const rgbd::BopScene> scene, std::vector<int> ids);

  rgbd::Frame Look(const geometry::Rigid& T_world_camera, std::uint32_t seed) const override;
  std::vector<geometry::Rigid> Viewpoints() const override;  // Same order as ids().
  geometry::Rigid StartPose() const override;
  geometry::PinholeCamera Camera() const override;
  motion::Obstacles Furniture() const override;
  std::vector<TrueObject> Truth() const override;  // Points are empty: the caller has the mesh.

  const std::vector<int>& ids() const { return ids_; }
  int NearestId(const geometry::Rigid& T_world_camera) const;
  // The recording's world to this one's.
  const geometry::Rigid& T_world_recording() const { return T_world_recording_; }

 private:
  std::shared_ptr<const rgbd::BopScene> scene_;
  std::vector<int> ids_;
  std::vector<geometry::Rigid> T_world_cameras_;
  geometry::Rigid T_world_recording_ = geometry::Rigid::Identity();
};

}  // namespace vantage::simulation
