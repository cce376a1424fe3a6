#include "motion/arm_model.h"

#include <urdf_parser/urdf_parser.h>

#include <fstream>
#include <random>
#include <sstream>
#include <stdexcept>

namespace vantage::motion {
namespace {

constexpr int kPostures = 6000;

geometry::Rigid ToRigid(const urdf::Pose& pose) {
  geometry::Rigid rigid = geometry::Rigid::Identity();
  rigid.translation() = Eigen::Vector3d(pose.position.x, pose.position.y, pose.position.z);
  rigid.linear() =
      Eigen::Quaterniond(pose.rotation.w, pose.rotation.x, pose.rotation.y, pose.rotation.z).normalized().toRotationMatrix();
  return rigid;
}

ArmShape ToShape(const urdf::Collision& collision, const std::string& link) {
  ArmShape shape;
  shape.T_link_shape = ToRigid(collision.origin);
  if (const auto* box = dynamic_cast<const urdf::Box*>(collision.geometry.get())) {
    shape.size_m = {box->dim.x, box->dim.y, box->dim.z};
  } else if (const auto* cylinder = dynamic_cast<const urdf::Cylinder*>(collision.geometry.get())) {
    shape.kind = ArmShape::Kind::kCylinder;
    shape.size_m = {cylinder->radius, cylinder->length, 0.0};
  } else if (const auto* sphere = dynamic_cast<const urdf::Sphere*>(collision.geometry.get())) {
    shape.kind = ArmShape::Kind::kSphere;
    shape.size_m = {sphere->radius, 0.0, 0.0};
  } else {
    throw std::runtime_error("link '" + link + "': collision shapes must be boxes, cylinders or spheres");
  }
  return shape;
}

ArmLink ToLink(const urdf::Link& link) {
  ArmLink result;
  result.name = link.name;
  for (const auto& collision : link.collision_array) result.shapes.push_back(ToShape(*collision, link.name));
  if (!link.parent_joint) return result;
  const urdf::Joint& joint = *link.parent_joint;
  if (joint.type != urdf::Joint::REVOLUTE || !joint.limits || !(joint.limits->lower < joint.limits->upper) ||
      !(joint.limits->velocity > 0.0)) {
    throw std::runtime_error("joint '" + joint.name + "' must be revolute with limits: lower < upper, velocity > 0");
  }
  result.T_parent_joint = ToRigid(joint.parent_to_joint_origin_transform);
  result.axis = Eigen::Vector3d(joint.axis.x, joint.axis.y, joint.axis.z).normalized();
  result.lower_rad = joint.limits->lower;
  result.upper_rad = joint.limits->upper;
  result.max_speed_rad_s = joint.limits->velocity;
  return result;
}

// Lengths along the chain bound how far anything gets from a joint, however it bends.
Eigen::MatrixXd Reaches(const ArmModel& arm) {
  const auto count = static_cast<Eigen::Index>(arm.links.size());
  Eigen::MatrixXd reach = Eigen::MatrixXd::Zero(count - 1, count);
  for (Eigen::Index j = 0; j + 1 < count; ++j) {
    double along_m = 0.0;
    for (Eigen::Index k = j + 1; k < count; ++k) {
      const ArmLink& link = arm.links[static_cast<std::size_t>(k)];
      if (k > j + 1) along_m += link.T_parent_joint.translation().norm();
      double furthest_m = k + 1 == count ? arm.T_flange_camera.translation().norm() : 0.0;
      for (const ArmShape& shape : link.shapes) {
        furthest_m = std::max(furthest_m, shape.T_link_shape.translation().norm() + shape.RadiusAboutItsMiddle());
      }
      reach(j, k) = along_m + furthest_m;
    }
  }
  return reach;
}

std::vector<ArmModel::Posture> SpreadPostures(const ArmModel& arm) {
  std::mt19937 random(7);
  std::vector<ArmModel::Posture> postures;
  for (int i = 0; i < kPostures; ++i) {
    Eigen::VectorXd joints(arm.joints());
    for (Eigen::Index j = 0; j < joints.size(); ++j) {
      const ArmLink& link = arm.links[static_cast<std::size_t>(j) + 1];
      joints[j] = link.lower_rad + (link.upper_rad - link.lower_rad) * (random() / 4294967296.0);
    }
    const geometry::Rigid camera = arm.CameraPose(joints);
    postures.push_back({joints, camera.translation(), camera.linear().col(2)});
  }
  return postures;
}

ArmModel Parse(const std::string& xml, const ArmMountParams& params) {
  const auto robot = urdf::parseURDF(xml);
  if (!robot || !robot->getRoot()) throw std::runtime_error("is no URDF");
  ArmModel arm;
  arm.params = params;
  for (urdf::LinkConstSharedPtr link = robot->getRoot(); link;) {
    arm.links.push_back(ToLink(*link));
    if (link->child_links.size() > 1) throw std::runtime_error("link '" + link->name + "' branches; the arm must be one chain");
    link = link->child_links.empty() ? nullptr : link->child_links.front();
  }
  if (arm.joints() < 5) throw std::runtime_error("an arm needs at least 5 joints, has " + std::to_string(arm.joints()));
  arm.T_world_base.translation() = params.base_position_m;
  arm.T_world_base.linear() = (Eigen::AngleAxisd(params.base_yaw_rad, Eigen::Vector3d::UnitZ()) *
                               Eigen::AngleAxisd(params.base_roll_rad, Eigen::Vector3d::UnitX()))
                                  .toRotationMatrix();
  arm.T_flange_camera = CameraOnMount(params.camera_position_m, params.camera_rotation_rad);
  arm.reach_m = Reaches(arm);
  arm.postures = SpreadPostures(arm);
  return arm;
}

}  // namespace

double ArmShape::RadiusAboutItsMiddle() const {
  switch (kind) {
    case Kind::kBox:
      return size_m.norm() / 2.0;
    case Kind::kCylinder:
      return std::hypot(size_m[0], size_m[1] / 2.0);
    case Kind::kSphere:
      break;
  }
  return size_m[0];
}

std::vector<geometry::Rigid> ArmModel::LinkPoses(const Eigen::VectorXd& joints_rad) const {
  std::vector<geometry::Rigid> poses{T_world_base};
  poses.reserve(links.size());
  for (std::size_t k = 1; k < links.size(); ++k) {
    const Eigen::AngleAxisd turn(joints_rad[static_cast<Eigen::Index>(k) - 1], links[k].axis);
    poses.push_back(poses.back() * links[k].T_parent_joint * turn);
  }
  return poses;
}

geometry::Rigid ArmModel::CameraPose(const Eigen::VectorXd& joints_rad) const {
  return LinkPoses(joints_rad).back() * T_flange_camera;
}

bool ArmModel::IsWithinLimits(const Eigen::VectorXd& joints_rad) const {
  if (joints_rad.size() != joints() || !joints_rad.allFinite()) return false;
  for (Eigen::Index j = 0; j < joints(); ++j) {
    const ArmLink& link = links[static_cast<std::size_t>(j) + 1];
    if (joints_rad[j] < link.lower_rad - 1e-9 || joints_rad[j] > link.upper_rad + 1e-9) return false;
  }
  return true;
}

std::shared_ptr<const ArmModel> LoadArm(const ArmMountParams& params) {
  std::ifstream stream(params.urdf);
  if (!stream) throw std::runtime_error(params.urdf + ": cannot be read; mount.arm.urdf must name the arm's URDF file");
  std::ostringstream text;
  text << stream.rdbuf();
  try {
    return std::make_shared<const ArmModel>(Parse(text.str(), params));
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(params.urdf + ": " + error.what());
  }
}

}  // namespace vantage::motion
