// The arm's surface as points, for the second opinion on its paths: joint by joint from the URDF's numbers, without KDL and FCL.
#include <cmath>

#include "motion/arm_model.h"

namespace vantage::motion {
namespace {

constexpr double kSpacing_m = 0.02;

int Steps(double length_m) { return std::max(1, static_cast<int>(std::ceil(length_m / kSpacing_m))); }

void AddBox(const ArmShape& shape, std::vector<Eigen::Vector3d>& points) {
  const int nx = Steps(shape.size_m.x()), ny = Steps(shape.size_m.y()), nz = Steps(shape.size_m.z());
  for (int x = 0; x <= nx; ++x) {
    for (int y = 0; y <= ny; ++y) {
      for (int z = 0; z <= nz; ++z) {
        const bool inside = x > 0 && x < nx && y > 0 && y < ny && z > 0 && z < nz;
        if (inside) continue;
        const Eigen::Vector3d share(double(x) / nx - 0.5, double(y) / ny - 0.5, double(z) / nz - 0.5);
        points.push_back(shape.T_link_shape * Eigen::Vector3d(share.cwiseProduct(shape.size_m)));
      }
    }
  }
}

void AddCylinder(const ArmShape& shape, std::vector<Eigen::Vector3d>& points) {
  const double radius = shape.size_m[0], length = shape.size_m[1];
  const int around = Steps(2.0 * M_PI * radius), along = Steps(length), rings = Steps(radius);
  for (int i = 0; i < around; ++i) {
    const double angle = 2.0 * M_PI * i / around;
    for (int k = 0; k <= along; ++k) {
      const bool is_end = k == 0 || k == along;
      for (int r = is_end ? 0 : rings; r <= rings; ++r) {
        const double distance = radius * r / rings;
        points.push_back(shape.T_link_shape * Eigen::Vector3d(distance * std::cos(angle), distance * std::sin(angle),
                                                              length * (double(k) / along - 0.5)));
      }
    }
  }
}

void AddSphere(const ArmShape& shape, std::vector<Eigen::Vector3d>& points) {
  const double radius = shape.size_m[0];
  const int rows = Steps(M_PI * radius);
  for (int r = 0; r <= rows; ++r) {
    const double polar = M_PI * r / rows, across = radius * std::sin(polar);
    const int around = Steps(2.0 * M_PI * across);
    for (int i = 0; i < around; ++i) {
      const double angle = 2.0 * M_PI * i / around;
      points.push_back(shape.T_link_shape *
                       Eigen::Vector3d(across * std::cos(angle), across * std::sin(angle), radius * std::cos(polar)));
    }
  }
}

// Distance from a point to a shape, in the shape's own frame; negative inside.
double DistanceTo(const ArmShape& shape, const Eigen::Vector3d& point) {
  switch (shape.kind) {
    case ArmShape::Kind::kBox: {
      const Eigen::Vector3d outside = point.cwiseAbs() - shape.size_m / 2.0;
      return outside.maxCoeff() <= 0.0 ? outside.maxCoeff() : outside.cwiseMax(0.0).norm();
    }
    case ArmShape::Kind::kCylinder: {
      const Eigen::Vector2d outside(point.head<2>().norm() - shape.size_m[0], std::abs(point.z()) - shape.size_m[1] / 2.0);
      return outside.maxCoeff() <= 0.0 ? outside.maxCoeff() : outside.cwiseMax(0.0).norm();
    }
    case ArmShape::Kind::kSphere:
      break;
  }
  return point.norm() - shape.size_m[0];
}

// T_world_link of every link.
std::vector<geometry::Rigid> Stand(const ArmModel& arm, const Eigen::VectorXd& joints_rad) {
  std::vector<geometry::Rigid> poses{arm.T_world_base};
  for (std::size_t k = 1; k < arm.links.size(); ++k) {
    const double angle = joints_rad[static_cast<Eigen::Index>(k) - 1];
    const Eigen::Vector3d& n = arm.links[k].axis;
    Eigen::Matrix3d cross;
    cross << 0, -n.z(), n.y(), n.z(), 0, -n.x(), -n.y(), n.x(), 0;
    geometry::Rigid turn = geometry::Rigid::Identity();  // Rodrigues.
    turn.linear() += std::sin(angle) * cross + (1.0 - std::cos(angle)) * cross * cross;
    poses.push_back(poses.back() * arm.links[k].T_parent_joint * turn);
  }
  return poses;
}

// The surface points of each link against the shapes of those that are not its neighbours.
double SelfClearance(const ArmModel& arm, const std::vector<geometry::Rigid>& poses,
                     const std::vector<std::vector<Eigen::Vector3d>>& surfaces) {
  double least_m = std::numeric_limits<double>::infinity();
  for (std::size_t k = 2; k < surfaces.size(); ++k) {
    for (std::size_t i = 0; i + 1 < k; ++i) {
      for (const ArmShape& shape : arm.links[i].shapes) {
        const geometry::Rigid T_shape_link = (poses[i] * shape.T_link_shape).inverse() * poses[k];
        for (const Eigen::Vector3d& point : surfaces[k]) least_m = std::min(least_m, DistanceTo(shape, T_shape_link * point));
      }
    }
  }
  return least_m;
}

}  // namespace

BodyAt ArmBody(std::shared_ptr<const ArmModel> arm) {
  std::vector<std::vector<Eigen::Vector3d>> surfaces;
  for (const ArmLink& link : arm->links) {
    std::vector<Eigen::Vector3d> points;
    for (const ArmShape& shape : link.shapes) {
      if (shape.kind == ArmShape::Kind::kBox) AddBox(shape, points);
      if (shape.kind == ArmShape::Kind::kCylinder) AddCylinder(shape, points);
      if (shape.kind == ArmShape::Kind::kSphere) AddSphere(shape, points);
    }
    surfaces.push_back(points);
  }
  return [arm = std::move(arm), surfaces](const Waypoint& waypoint) {
    const std::vector<geometry::Rigid> poses = Stand(*arm, waypoint.joints_rad);
    MountBody body;
    for (std::size_t k = 1; k < surfaces.size(); ++k) {  // The base is fixed where it stands.
      for (const Eigen::Vector3d& point : surfaces[k]) body.balls.push_back({poses[k] * point, 0.0});
    }
    body.self_clearance_m = SelfClearance(*arm, poses, surfaces);
    return body;
  };
}

}  // namespace vantage::motion
