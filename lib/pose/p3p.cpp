#include "pose/p3p.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

namespace vantage::pose {
namespace {

// The largest real root of x^3 + a x^2 + b x + c.
double LargestCubicRoot(double a, double b, double c) {
  const double q = (a * a - 3.0 * b) / 9.0;
  const double r = (2.0 * a * a * a - 9.0 * a * b + 27.0 * c) / 54.0;
  double root;
  if (r * r < q * q * q) {
    const double theta = std::acos(std::clamp(r / std::sqrt(q * q * q), -1.0, 1.0));
    root = -2.0 * std::sqrt(q) * std::cos((theta + 2.0 * M_PI) / 3.0);
    root = std::max(root, -2.0 * std::sqrt(q) * std::cos((theta - 2.0 * M_PI) / 3.0));
    root = std::max(root, -2.0 * std::sqrt(q) * std::cos(theta / 3.0)) - a / 3.0;
  } else {
    const double s = -std::copysign(std::cbrt(std::abs(r) + std::sqrt(std::max(0.0, r * r - q * q * q))), r);
    root = s + (s == 0.0 ? 0.0 : q / s) - a / 3.0;
  }
  for (int i = 0; i < 2; ++i) {
    const double slope = (3.0 * root + 2.0 * a) * root + b;
    if (std::abs(slope) > 1e-12) root -= (((root + a) * root + b) * root + c) / slope;
  }
  return root;
}

int SolveQuadratic(double p, double q, double* roots) {
  const double discriminant = 0.25 * p * p - q;
  if (discriminant < 0.0) return 0;
  const double t = -0.5 * p - std::copysign(std::sqrt(discriminant), p);
  roots[0] = t;
  roots[1] = t != 0.0 ? q / t : 0.0;
  return 2;
}

// The rotation and translation that map triangle `from` onto the congruent triangle `to` (columns are corners).
geometry::Rigid AlignTriangles(const Eigen::Matrix3d& from, const Eigen::Matrix3d& to) {
  const auto axes = [](const Eigen::Matrix3d& corners) {
    Eigen::Matrix3d frame;
    frame.col(0) = (corners.col(1) - corners.col(0)).normalized();
    frame.col(2) = frame.col(0).cross(corners.col(2) - corners.col(0)).normalized();
    frame.col(1) = frame.col(2).cross(frame.col(0));
    return frame;
  };
  geometry::Rigid T = geometry::Rigid::Identity();
  T.linear() = axes(to) * axes(from).transpose();
  T.translation() = to.rowwise().mean() - T.linear() * from.rowwise().mean();
  return T;
}

// Newton on the three law-of-cosines equations; `s` are the distances along the rays.
void PolishDistances(const Eigen::Vector3d& cosines, const Eigen::Vector3d& squared_sides, Eigen::Vector3d* s) {
  static constexpr int kPairs[3][2] = {{1, 2}, {0, 2}, {0, 1}};
  for (int iteration = 0; iteration < 2; ++iteration) {
    Eigen::Vector3d residual;
    Eigen::Matrix3d jacobian = Eigen::Matrix3d::Zero();
    for (int k = 0; k < 3; ++k) {
      const int i = kPairs[k][0], j = kPairs[k][1];
      const double si = (*s)(i), sj = (*s)(j);
      residual(k) = si * si + sj * sj - 2.0 * si * sj * cosines(k) - squared_sides(k);
      jacobian(k, i) = 2.0 * (si - sj * cosines(k));
      jacobian(k, j) = 2.0 * (sj - si * cosines(k));
    }
    if (std::abs(jacobian.determinant()) < 1e-14) return;
    *s -= jacobian.inverse() * residual;
  }
}

}  // namespace

int SolveQuartic(double b, double c, double d, double e, std::array<double, 4>* roots) {
  // Depressed quartic y^4 + p y^2 + q y + r, x = y - b / 4, split into two quadratics (Descartes).
  const double p = c - 3.0 * b * b / 8.0;
  const double q = d - 0.5 * b * c + b * b * b / 8.0;
  const double r = e - 0.25 * b * d + b * b * c / 16.0 - 3.0 * b * b * b * b / 256.0;
  int count = 0;
  const double z = LargestCubicRoot(2.0 * p, p * p - 4.0 * r, -q * q);
  if (z > 1e-14) {
    const double u = std::sqrt(z);
    const double half = 0.5 * (p + z);
    count += SolveQuadratic(u, half - 0.5 * q / u, roots->data() + count);
    count += SolveQuadratic(-u, half + 0.5 * q / u, roots->data() + count);
  } else {  // Biquadratic.
    double squares[2];
    for (int i = 0, n = SolveQuadratic(p, r, squares); i < n; ++i) {
      if (squares[i] < 0.0) continue;
      (*roots)[count++] = std::sqrt(squares[i]);
      (*roots)[count++] = -std::sqrt(squares[i]);
    }
  }
  for (int i = 0; i < count; ++i) {
    double& x = (*roots)[i];
    x -= 0.25 * b;
    for (int k = 0; k < 2; ++k) {
      const double slope = ((4.0 * x + 3.0 * b) * x + 2.0 * c) * x + d;
      if (std::abs(slope) > 1e-12) x -= ((((x + b) * x + c) * x + d) * x + e) / slope;
    }
  }
  return count;
}

P3pSolutions SolveP3p(const Eigen::Matrix3d& rays, const Eigen::Matrix3d& points) {
  P3pSolutions solutions;
  const double a2 = (points.col(1) - points.col(2)).squaredNorm();
  const double b2 = (points.col(0) - points.col(2)).squaredNorm();
  const double c2 = (points.col(0) - points.col(1)).squaredNorm();
  const double area = (points.col(1) - points.col(0)).cross(points.col(2) - points.col(0)).norm();
  if (area < 1e-9 || b2 < 1e-12) return solutions;

  const double ca = rays.col(1).dot(rays.col(2));
  const double cb = rays.col(0).dot(rays.col(2));
  const double cg = rays.col(0).dot(rays.col(1));
  const double k = (a2 - c2) / b2, sum = (a2 + c2) / b2, cc = c2 / b2, aa = a2 / b2;
  const double a4 = (k - 1.0) * (k - 1.0) - 4.0 * cc * ca * ca;
  const double a3 = 4.0 * (k * (1.0 - k) * cb - (1.0 - sum) * ca * cg + 2.0 * cc * ca * ca * cb);
  const double a2_coefficient = 2.0 * (k * k - 1.0 + 2.0 * k * k * cb * cb + 2.0 * (1.0 - cc) * ca * ca - 4.0 * sum * ca * cb * cg +
                                       2.0 * (1.0 - aa) * cg * cg);
  const double a1 = 4.0 * (-k * (1.0 + k) * cb + 2.0 * aa * cg * cg * cb - (1.0 - sum) * ca * cg);
  const double a0 = (1.0 + k) * (1.0 + k) - 4.0 * aa * cg * cg;
  if (std::abs(a4) < 1e-14) return solutions;

  std::array<double, 4> roots;
  const int count = SolveQuartic(a3 / a4, a2_coefficient / a4, a1 / a4, a0 / a4, &roots);
  for (int i = 0; i < count; ++i) {
    const double v = roots[i];
    const double divisor = 2.0 * (cg - v * ca);
    if (!(v > 0.0) || std::abs(divisor) < 1e-12) continue;
    const double u = ((k - 1.0) * v * v - 2.0 * k * cb * v + 1.0 + k) / divisor;
    const double s1_squared = b2 / (1.0 + v * v - 2.0 * v * cb);
    if (!(u > 0.0) || !(s1_squared > 0.0)) continue;
    const double s1 = std::sqrt(s1_squared);
    Eigen::Vector3d s(s1, u * s1, v * s1);
    PolishDistances({ca, cb, cg}, {a2, b2, c2}, &s);
    if (!(s.minCoeff() > 0.0) || !s.allFinite()) continue;
    solutions.T_camera_object[solutions.count++] = AlignTriangles(points, rays * s.asDiagonal());
  }
  return solutions;
}

}  // namespace vantage::pose
