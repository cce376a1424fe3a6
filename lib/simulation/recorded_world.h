// A recording whose views can be visited: the camera can go to any recorded pose and sees its real image there.
#pragma once

#include "rgbd/bop.h"
#include "simulation/world.h"

namespace vantage::simulation {

class RecordedWorld : public World {
 public:
  // `ids`: the frames that can be visited. World frame: the recording's with the table's plane at z = 0 and the cameras above it; a
  // recording whose cameras are at negative z (mean) is turned over, by half a turn about x.
  // Throws std::runtime_error where there are no ids, or a frame has no camera pose or does not exist.
  RecordedWorld(std::shared_ptr<const rgbd::BopScene> scene, std::vector<int> ids);

  // Reads the recorded frame nearest to that pose; T_world_camera of the result is its own pose, in this world's frame. The seed
  // has no effect. Throws as BopScene::Load.
  rgbd::Frame Look(const geometry::Rigid& T_world_camera, std::uint32_t seed) const override;
  std::vector<geometry::Rigid> Viewpoints() const override;  // Same order as ids().
  geometry::Rigid StartPose() const override;                // Of the first id.
  geometry::PinholeCamera Camera() const override;           // Of the first id.
  motion::Obstacles Furniture() const override;              // The table, as a slab of 3 x 3 m under the cameras.
  // Named "object_N" by the BOP number, at their poses in the first frame that knows them. Points are empty: the caller has the
  // mesh.
  std::vector<TrueObject> Truth() const override;

  const std::vector<int>& ids() const { return ids_; }
  // The visitable frame whose pose is nearest: metres, and 0.5 m for a radian.
  int NearestId(const geometry::Rigid& T_world_camera) const;
  // The recording's world to this one's.
  const geometry::Rigid& T_world_recording() const { return T_world_recording_; }

 private:
  std::shared_ptr<const rgbd::BopScene> scene_;
  std::vector<int> ids_;
  std::vector<geometry::Rigid> T_world_cameras_;  // Same order as ids_.
  geometry::PinholeCamera camera_;
  geometry::Rigid T_world_recording_ = geometry::Rigid::Identity();
};

}  // namespace vantage::simulation
