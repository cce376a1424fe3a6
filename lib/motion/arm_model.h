// A serial arm read from URDF: kinematics, limits, the shapes of its links. Internal to motion.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "motion/mount.h"

namespace vantage::motion {

struct ArmShape {
  enum class Kind { kBox, kCylinder, kSphere };
  Kind kind = Kind::kBox;
  geometry::Rigid T_link_shape = geometry::Rigid::Identity();
  Eigen::Vector3d size_m = Eigen::Vector3d::Zero();  // Box: edges. Cylinder: radius, length (along z), -. Sphere: radius, -, -.

  double RadiusAboutItsMiddle() const;  // Of the ball that holds it.
};

// A link and the joint that moves it; the base has no joint.
struct ArmLink {
  std::string name;
  geometry::Rigid T_parent_joint = geometry::Rigid::Identity();
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
  double lower_rad = 0.0, upper_rad = 0.0, max_speed_rad_s = 0.0;
  std::vector<ArmShape> shapes;
};

struct ArmModel {
  geometry::Rigid T_world_base = geometry::Rigid::Identity();
  geometry::Rigid T_flange_camera = geometry::Rigid::Identity();
  std::vector<ArmLink> links;  // links[0] is the base; joint j moves links[j + 1].
  // reach_m(j, k): no point of links[k] is ever further than this from the axis of joint j, for j < k.
  Eigen::MatrixXd reach_m;
  ArmMountParams params;
  // Postures spread over the joints' ranges, with what the camera does there: where the inverse kinematics starts.
  struct Posture {
    Eigen::VectorXd joints_rad;
    Eigen::Vector3d camera_in_world, optical_axis;
  };
  std::vector<Posture> postures;

  Eigen::Index joints() const { return static_cast<Eigen::Index>(links.size()) - 1; }
  std::vector<geometry::Rigid> LinkPoses(const Eigen::VectorXd& joints_rad) const;  // T_world_link of every link.
  geometry::Rigid CameraPose(const Eigen::VectorXd& joints_rad) const;              // T_world_camera.
  bool IsWithinLimits(const Eigen::VectorXd& joints_rad) const;
};

// Throws std::runtime_error "FILE: what is wrong".
std::shared_ptr<const ArmModel> LoadArm(const ArmMountParams& params);

// Among obstacles (arm_mount.cpp).
std::unique_ptr<Mount> MakeArmMount(std::shared_ptr<const ArmModel> arm, const Obstacles& obstacles);

// The arm's surface as points some 2 cm apart, by a kinematics of its own (arm_body.cpp): for AuditPath.
BodyAt ArmBody(std::shared_ptr<const ArmModel> arm);

}  // namespace vantage::motion
