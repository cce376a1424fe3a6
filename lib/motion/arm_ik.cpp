#include "motion/arm_ik.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <kdl/chain.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainjnttojacsolver.hpp>

namespace vantage::motion {
namespace {

constexpr int kMaxIterations = 40;
constexpr double kMaxStep_rad = 0.5;
constexpr double kPlace_m = 1e-4, kAim_rad = 2e-4;
constexpr double kMetresPerRadian = 0.3;  // An aim that is off by a radian weighs like so many metres.
constexpr double kDifferent_rad = 0.3;
constexpr double kDamping = 1e-4;

KDL::Frame ToKdl(const geometry::Rigid& pose) {
  const auto& r = pose.linear();
  const auto& p = pose.translation();
  return {KDL::Rotation(r(0, 0), r(0, 1), r(0, 2), r(1, 0), r(1, 1), r(1, 2), r(2, 0), r(2, 1), r(2, 2)),
          KDL::Vector(p.x(), p.y(), p.z())};
}

KDL::Chain ToChain(const ArmModel& arm) {
  KDL::Chain chain;
  chain.addSegment(KDL::Segment(KDL::Joint(KDL::Joint::Fixed), ToKdl(arm.T_world_base)));
  for (std::size_t k = 1; k < arm.links.size(); ++k) {
    const ArmLink& link = arm.links[k];
    const KDL::Frame origin = ToKdl(link.T_parent_joint);
    const KDL::Vector axis(link.axis.x(), link.axis.y(), link.axis.z());
    chain.addSegment(KDL::Segment(KDL::Joint(link.name, origin.p, origin.M * axis, KDL::Joint::RotAxis), origin));
  }
  chain.addSegment(KDL::Segment(KDL::Joint(KDL::Joint::Fixed), ToKdl(arm.T_flange_camera)));
  return chain;
}

// See ArmIk::SolveFrom. A chain of the caller's own: KDL's joints keep the last pose asked for, const or not, so threads must not
// share one.
std::optional<Eigen::VectorXd> SolveWith(const KDL::Chain& chain, const ArmModel& arm, const geometry::Rigid& T_world_camera,
                                         const Eigen::VectorXd& start_rad) {
  KDL::ChainFkSolverPos_recursive position(chain);
  KDL::ChainJntToJacSolver rates(chain);
  KDL::JntArray joints(static_cast<unsigned>(arm.joints()));
  KDL::Jacobian jacobian(static_cast<unsigned>(arm.joints()));
  joints.data = start_rad;
  const Eigen::Vector3d wanted_axis = T_world_camera.linear().col(2);
  double last_error = 1e9;
  int stalled = 0;
  for (int i = 0; i < kMaxIterations; ++i) {
    KDL::Frame frame;
    position.JntToCart(joints, frame);
    const Eigen::Vector3d place(frame.p.x(), frame.p.y(), frame.p.z());
    const Eigen::Matrix3d axes = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(frame.M.data);
    const Eigen::Vector3d off = T_world_camera.translation() - place;
    const Eigen::Vector3d axis = axes.col(2);
    const Eigen::Vector3d cross = axis.cross(wanted_axis);
    const double angle = std::atan2(cross.norm(), axis.dot(wanted_axis));
    if (off.norm() < kPlace_m && angle < kAim_rad) return joints.data;
    const double error = off.norm() + kMetresPerRadian * angle;
    stalled = error > 0.9 * last_error ? stalled + 1 : 0;
    if (stalled > 5) return std::nullopt;
    last_error = error;

    // Five equations: the place, and the two turns that move the optical axis.
    rates.JntToJac(joints, jacobian);
    Eigen::Matrix<double, 5, Eigen::Dynamic> a(5, arm.joints());
    a.topRows<3>() = jacobian.data.topRows<3>();
    a.bottomRows<2>() = kMetresPerRadian * axes.leftCols<2>().transpose() * jacobian.data.bottomRows<3>();
    Eigen::Matrix<double, 5, 1> b;
    b.head<3>() = off;
    const Eigen::Vector3d turn =
        cross.norm() > 1e-12 ? Eigen::Vector3d(cross / cross.norm() * angle) : Eigen::Vector3d(axes.col(0) * angle);
    b.tail<2>() = kMetresPerRadian * axes.leftCols<2>().transpose() * turn;
    Eigen::Matrix<double, 5, 5> normal = a * a.transpose();
    normal.diagonal().array() += kDamping;
    Eigen::VectorXd step = a.transpose() * normal.ldlt().solve(b);
    const double largest = step.cwiseAbs().maxCoeff();
    if (largest > kMaxStep_rad) step *= kMaxStep_rad / largest;
    for (Eigen::Index j = 0; j < arm.joints(); ++j) {
      const ArmLink& link = arm.links[static_cast<std::size_t>(j) + 1];
      joints(static_cast<unsigned>(j)) = std::clamp(joints(static_cast<unsigned>(j)) + step[j], link.lower_rad, link.upper_rad);
    }
  }
  return std::nullopt;
}

}  // namespace

struct ArmIk::Impl {
  std::shared_ptr<const ArmModel> arm;
  KDL::Chain chain;
};

ArmIk::ArmIk(std::shared_ptr<const ArmModel> arm) : impl_(std::make_unique<Impl>()) {
  impl_->chain = ToChain(*arm);
  impl_->arm = std::move(arm);
}

ArmIk::~ArmIk() = default;

std::optional<Eigen::VectorXd> ArmIk::SolveFrom(const geometry::Rigid& T_world_camera, const Eigen::VectorXd& start_rad) const {
  return SolveWith(KDL::Chain(impl_->chain), *impl_->arm, T_world_camera, start_rad);
}

std::vector<Eigen::VectorXd> ArmIk::Solve(const geometry::Rigid& T_world_camera) const {
  const ArmModel& arm = *impl_->arm;
  const Eigen::Vector3d place = T_world_camera.translation(), axis = T_world_camera.linear().col(2);
  std::vector<std::pair<double, const ArmModel::Posture*>> nearest;
  nearest.reserve(arm.postures.size());
  for (const ArmModel::Posture& posture : arm.postures) {
    const double aim = 2.0 * kMetresPerRadian * kMetresPerRadian * (1.0 - posture.optical_axis.dot(axis));
    nearest.emplace_back((posture.camera_in_world - place).squaredNorm() + aim, &posture);
  }
  const auto seeds = std::min<std::size_t>(static_cast<std::size_t>(arm.params.ik_seeds), nearest.size());
  std::partial_sort(nearest.begin(), nearest.begin() + static_cast<std::ptrdiff_t>(seeds), nearest.end(),
                    [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<Eigen::VectorXd> solutions;
  const KDL::Chain chain = impl_->chain;
  for (std::size_t i = 0; i < seeds; ++i) {
    const auto solution = SolveWith(chain, arm, T_world_camera, nearest[i].second->joints_rad);
    if (!solution) continue;
    const bool known = std::any_of(solutions.begin(), solutions.end(), [&](const Eigen::VectorXd& other) {
      return (other - *solution).cwiseAbs().maxCoeff() < kDifferent_rad;
    });
    if (!known) solutions.push_back(*solution);
  }
  return solutions;
}

}  // namespace vantage::motion
