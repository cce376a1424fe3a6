#include "motion/path_audit.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace vantage::motion {
namespace {

constexpr int kMaxSteps = 2000;  // Of the descent; it has converged long before.

// Distance from a point to a box; negative inside.
double DistanceToBox(const Eigen::Vector3d& point_in_world, const BoxObstacle& box) {
  const Eigen::Vector3d outside = (box.T_world_box.inverse() * point_in_world).cwiseAbs() - box.size_m / 2.0;
  const double deepest = outside.maxCoeff();
  return deepest <= 0.0 ? deepest : outside.cwiseMax(0.0).norm();
}

struct Cloud {
  const HullObstacle* obstacle;
  Eigen::Matrix3Xd points;
  Eigen::Vector3d centre;
  double radius_m;
};

Cloud MakeCloud(const HullObstacle& obstacle) {
  if (obstacle.points_in_world.empty()) throw std::invalid_argument("obstacle hull '" + obstacle.name + "' has no points");
  Cloud cloud{&obstacle, Eigen::Matrix3Xd(3, static_cast<Eigen::Index>(obstacle.points_in_world.size())), {}, 0.0};
  for (std::size_t i = 0; i < obstacle.points_in_world.size(); ++i) {
    cloud.points.col(static_cast<Eigen::Index>(i)) = obstacle.points_in_world[i];
  }
  cloud.centre = cloud.points.rowwise().mean();
  cloud.radius_m = std::sqrt((cloud.points.colwise() - cloud.centre).colwise().squaredNorm().maxCoeff());
  return cloud;
}

// Distance from a point to the convex set that the cloud's points span, to the tolerance; 0 inside; any bound above `enough_m` will
// do where it is further away. Every step moves weight from the worst point in use to the best one there is (Frank and Wolfe's
// method with pairwise steps, Lacoste-Julien and Jaggi, 2015).
double DistanceToCloud(const Eigen::Vector3d& point, const Cloud& cloud, double enough_m) {
  const double far_m = (point - cloud.centre).norm() - cloud.radius_m;
  if (far_m > enough_m) return far_m;
  std::vector<std::pair<Eigen::Index, double>> weights{{0, 1.0}};
  Eigen::Vector3d x = cloud.points.col(0) - point;  // From the point.
  for (int step = 0; step < kMaxSteps; ++step) {
    const double distance = x.norm();
    if (distance < kAuditTolerance_m) return 0.0;
    Eigen::Index best = 0;
    const double support = (x.transpose() * cloud.points).minCoeff(&best) - x.dot(point);
    const double bound = support / distance;  // No point of the set is nearer than this.
    if (bound > enough_m || distance - bound < kAuditTolerance_m) return bound;
    std::size_t worst = 0;
    for (std::size_t i = 1; i < weights.size(); ++i) {
      if (x.dot(cloud.points.col(weights[i].first)) > x.dot(cloud.points.col(weights[worst].first))) worst = i;
    }
    const Eigen::Vector3d way = cloud.points.col(best) - cloud.points.col(weights[worst].first);
    const double length = std::clamp(-x.dot(way) / std::max(way.squaredNorm(), 1e-18), 0.0, weights[worst].second);
    x += length * way;
    weights[worst].second -= length;
    if (weights[worst].second <= 0.0) weights.erase(weights.begin() + static_cast<std::ptrdiff_t>(worst));
    const auto known = std::find_if(weights.begin(), weights.end(), [&](const auto& entry) { return entry.first == best; });
    if (known != weights.end()) {
      known->second += length;
    } else {
      weights.emplace_back(best, length);
    }
  }
  return 0.0;  // Not decided: the pessimist's answer.
}

void Note(double clearance_m, const std::string& obstacle, double time_s, PathAudit& audit) {
  if (clearance_m >= audit.clearance_m) return;
  audit.clearance_m = clearance_m;
  audit.obstacle = obstacle;
  audit.time_s = time_s;
}

}  // namespace

BodyAt CameraBall(double radius_m) {
  return [radius_m](const Waypoint& waypoint) {
    MountBody body;
    body.balls.push_back({waypoint.T_world_mount.translation(), radius_m});
    return body;
  };
}

PathAudit AuditPath(const Trajectory& path, const BodyAt& body, const Obstacles& obstacles, double step_s) {
  if (!(step_s > 0.0)) throw std::invalid_argument("step_s must be > 0, is " + std::to_string(step_s));
  std::vector<Cloud> clouds;
  for (const HullObstacle& hull : obstacles.hulls) clouds.push_back(MakeCloud(hull));
  PathAudit audit;
  audit.clearance_m = kFarAudit_m;
  if (path.waypoints.empty()) return audit;
  const int samples = static_cast<int>(std::ceil(path.duration_s() / step_s)) + 1;
  for (int i = 0; i < samples; ++i) {
    const double time_s = std::min(i * step_s, path.duration_s());
    const MountBody now = body(path.Sample(time_s));
    Note(now.self_clearance_m, "itself", time_s, audit);
    for (const BodyBall& ball : now.balls) {
      for (const BoxObstacle& box : obstacles.boxes) {
        Note(DistanceToBox(ball.centre_in_world, box) - ball.radius_m, box.name, time_s, audit);
      }
      for (const Cloud& cloud : clouds) {
        const double radius_m = std::max(ball.radius_m, kAuditTolerance_m);  // A point within the tolerance counts as inside.
        // What is taken off is added first: a loose bound must not count as nearer than all before it.
        const double distance_m = DistanceToCloud(ball.centre_in_world, cloud, audit.clearance_m + radius_m);
        Note(distance_m - radius_m, cloud.obstacle->name, time_s, audit);
      }
    }
  }
  return audit;
}

}  // namespace vantage::motion
