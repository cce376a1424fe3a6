#include "pose/dense.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>

#include "pose/normal_equations.h"

namespace vantage::pose {
namespace {

constexpr double kSmoothing_px = 1.2;

// Point to plane against the depth image.
void AddSurface(const SurfacePoint& sample, const rgbd::Frame& frame, const geometry::Rigid& T, NormalEquations* equations) {
  constexpr double kMaxDistance = 0.02;
  const Eigen::Vector3d p = T * sample.point;
  const Eigen::Vector3d normal = T.linear() * sample.normal;
  if (normal.dot(p.normalized()) > -0.2) return;  // Seen at a grazing angle or from behind.
  const auto pixel = frame.camera.Project(p);
  if (!pixel || !frame.camera.Contains(*pixel)) return;
  // A whole pixel: half a pixel beside it, its depth would be off a slanted surface.
  const auto measured = rgbd::PointAt(frame, pixel->array().round(), 1);
  if (!measured) return;
  const double distance = normal.dot(p - *measured);
  if (std::abs(distance) > kMaxDistance) return;
  const double inverse_sigma = 1.0 / DepthNoise{}.Sigma(measured->z());
  Vector6d jacobian;
  jacobian << normal, p.cross(normal);
  const double error = distance * inverse_sigma;
  equations->Add(jacobian * inverse_sigma, error, Cauchy(error * error, 2.0));
  ++equations->samples;
}

// See DenseFit.
std::optional<double> AgreementOf(const std::vector<SurfacePoint>& surface, const rgbd::Frame& frame, const geometry::Rigid& T) {
  constexpr int kEnough = 50;
  constexpr double kMinCosine = 0.3;
  constexpr double kMaxSigmas = 3.0;
  constexpr double kModelError_m = 0.001;  // The samples were measured themselves.
  int measured = 0, agree = 0;
  for (const SurfacePoint& sample : surface) {
    const Eigen::Vector3d p = T * sample.point;
    const Eigen::Vector3d normal = T.linear() * sample.normal;
    const auto pixel = frame.camera.Project(p);
    if (!pixel || !frame.camera.Contains(*pixel) || normal.dot(p.normalized()) > -kMinCosine) continue;
    const auto point = rgbd::PointAt(frame, pixel->array().round(), 1);
    if (!point) continue;
    ++measured;
    agree += std::abs(normal.dot(p - *point)) <= kMaxSigmas * DepthNoise{}.Sigma(point->z()) + kModelError_m;
  }
  return measured < kEnough ? std::nullopt : std::optional<double>(static_cast<double>(agree) / measured);
}

// A texture point as the frame shows it at a pose.
struct TextureResidual {
  double expected = 0.0;  // Brightness in the view.
  double seen = 0.0;      // In the frame.
  Vector6d jacobian;      // Of `seen`.
};

std::vector<TextureResidual> ResidualsOf(const std::vector<TexturePoint>& texture, const rgbd::Frame& frame,
                                         const SmoothImage& image, const geometry::Rigid& T) {
  constexpr double kMaxDepthError_m = 0.02;
  std::vector<TextureResidual> residuals;
  residuals.reserve(texture.size());
  for (const TexturePoint& sample : texture) {
    const Eigen::Vector3d p = T * sample.point;
    if ((T.linear() * sample.normal).dot(p.normalized()) > -kMinTextureCosine) continue;
    const auto pixel = frame.camera.Project(p);
    const auto seen = pixel ? image.At(*pixel) : std::nullopt;
    if (!seen) continue;
    const auto depth = rgbd::DepthAt(frame, *pixel, 0);
    if (depth && std::abs(*depth - p.z()) > kMaxDepthError_m) continue;
    const double inverse_z = 1.0 / p.z();
    const double gx = seen->gradient.x() * frame.camera.fx * inverse_z, gy = seen->gradient.y() * frame.camera.fy * inverse_z;
    const Eigen::Vector3d by_point(gx, gy, -(gx * p.x() + gy * p.y()) * inverse_z);
    TextureResidual residual{sample.brightness, seen->brightness, {}};
    residual.jacobian << by_point, p.cross(by_point);
    residuals.push_back(residual);
  }
  return residuals;
}

double Median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

// How far values lie from their middle, in the median.
double Scatter(std::vector<double> values, double middle) {
  for (double& value : values) value = std::abs(value - middle);
  return Median(std::move(values));
}

// One view's texture: mean and contrast are made the frame's first.
void AddTexture(const std::vector<TextureResidual>& residuals, double min_sigma, NormalEquations* equations) {
  constexpr std::size_t kFew = 12;
  constexpr double kMaxContrast = 2.0;
  constexpr double kSigmasPerMedian = 1.4826;
  if (residuals.size() < kFew) return;
  std::vector<double> expected, seen, errors;
  for (const TextureResidual& residual : residuals) {
    expected.push_back(residual.expected);
    seen.push_back(residual.seen);
  }
  const double middle_expected = Median(expected), middle_seen = Median(seen);
  const double contrast =
      std::clamp(Scatter(seen, middle_seen) / std::max(1.0, Scatter(expected, middle_expected)), 1.0 / kMaxContrast, kMaxContrast);
  for (const TextureResidual& residual : residuals) {
    errors.push_back(residual.seen - middle_seen - contrast * (residual.expected - middle_expected));
  }
  const double sigma = std::max(min_sigma, kSigmasPerMedian * Scatter(errors, 0.0));
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    const double error = errors[i] / sigma;
    equations->Add(residuals[i].jacobian / sigma, error, Cauchy(error * error, 2.0));
    ++equations->samples;
  }
}

// Pearson's correlation; nullopt where there is little to compare.
std::optional<double> Correlation(const std::vector<TextureResidual>& residuals) {
  constexpr std::size_t kEnough = 30;
  if (residuals.size() < kEnough) return std::nullopt;
  double mean_expected = 0.0, mean_seen = 0.0;
  for (const TextureResidual& residual : residuals) {
    mean_expected += residual.expected / residuals.size();
    mean_seen += residual.seen / residuals.size();
  }
  double both = 0.0, expected = 0.0, seen = 0.0;
  for (const TextureResidual& residual : residuals) {
    const double e = residual.expected - mean_expected, s = residual.seen - mean_seen;
    both += e * s;
    expected += e * e;
    seen += s * s;
  }
  return both / std::sqrt(std::max(1.0, expected * seen));
}

std::optional<double> LikenessOf(const Appearance& appearance, const rgbd::Frame& frame, const SmoothImage* image,
                                 const geometry::Rigid& T) {
  std::optional<double> likeness;
  if (!image) return likeness;
  for (const std::vector<TexturePoint>& texture : appearance.textures) {
    likeness = std::max(likeness, Correlation(ResidualsOf(texture, frame, *image, T)));  // Nothing is less than anything.
  }
  return likeness;
}

NormalEquations TextureEquations(const Appearance& appearance, const rgbd::Frame& frame, const SmoothImage* image,
                                 const geometry::Rigid& T, const DenseParams& params) {
  NormalEquations equations;
  if (!image) return equations;
  for (const std::vector<TexturePoint>& texture : appearance.textures) {
    AddTexture(ResidualsOf(texture, frame, *image, T), params.min_texture_sigma, &equations);
  }
  return equations;
}

double ShareOf(double independent, int samples) { return std::min(1.0, independent / std::max(1, samples)); }

void AddPrior(const PosePrior& prior, const geometry::Rigid& T, NormalEquations* equations) {
  const Eigen::Vector3d translation = T.translation() - prior.T_camera_object.translation();
  const Eigen::AngleAxisd turn(T.linear() * prior.T_camera_object.linear().transpose());
  const Eigen::Vector3d rotation = turn.angle() * turn.axis();
  const Eigen::Matrix3d lever = -Cross(T.translation());
  for (int axis = 0; axis < 3; ++axis) {
    Vector6d jacobian = Vector6d::Zero();
    jacobian(axis) = 1.0;
    jacobian.tail<3>() = lever.row(axis).transpose();
    equations->Add(jacobian / prior.sigma_m, translation(axis) / prior.sigma_m, 1.0);
    jacobian.setZero();
    jacobian(3 + axis) = 1.0;
    equations->Add(jacobian / prior.sigma_rad, rotation(axis) / prior.sigma_rad, 1.0);
  }
}

}  // namespace

void DenseParams::Check() const {
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(std::string("dense: ") + what);
  };
  require(independent_matches > 0.0, "independent_matches must be > 0");
  require(min_texture_sigma > 0.0, "min_texture_sigma must be > 0");
}

SmoothImage::SmoothImage(const rgbd::Frame& frame, const cv::Rect& area) {
  const cv::Rect inside = area & cv::Rect(0, 0, frame.color.cols, frame.color.rows);
  corner_ = inside.tl();
  if (inside.area() == 0) return;
  cv::Mat grey;
  cv::cvtColor(frame.color(inside), grey, cv::COLOR_BGR2GRAY);
  grey.convertTo(grey_, CV_32F);
  cv::GaussianBlur(grey_, grey_, {0, 0}, kSmoothing_px);
}

std::optional<SmoothImage::Sample> SmoothImage::At(const Eigen::Vector2d& pixel) const {
  const double x = pixel.x() - corner_.x, y = pixel.y() - corner_.y;
  if (!(x >= 1.0 && y >= 1.0 && x < grey_.cols - 2 && y < grey_.rows - 2)) return std::nullopt;
  const int column = static_cast<int>(x), row = static_cast<int>(y);
  const double a = x - column, b = y - row;
  const auto between = [&](int dx, int dy) {
    const float* upper = grey_[row + dy] + column + dx;
    const float* lower = grey_[row + dy + 1] + column + dx;
    return (1.0 - b) * ((1.0 - a) * upper[0] + a * upper[1]) + b * ((1.0 - a) * lower[0] + a * lower[1]);
  };
  return Sample{between(0, 0), {0.5 * (between(1, 0) - between(-1, 0)), 0.5 * (between(0, 1) - between(0, -1))}};
}

geometry::Rigid RefinePoseDensely(const std::vector<Match2d3d>& matches, const std::vector<int>& index,
                                  const Appearance& appearance, const rgbd::Frame& frame, const SmoothImage* image,
                                  const std::optional<PosePrior>& prior, const geometry::Rigid& T_camera_object, double scale_px,
                                  const DenseParams& params, int iterations) {
  const double match_share = ShareOf(params.independent_matches, static_cast<int>(index.size()));
  return GaussNewton(T_camera_object, iterations, [&](const geometry::Rigid& T, NormalEquations* equations) {
    NormalEquations of_matches;
    for (const int i : index) AddMatch(matches[i], frame.camera, T, scale_px, &of_matches);
    equations->AddScaled(of_matches, match_share);
    for (const SurfacePoint& sample : appearance.surface) AddSurface(sample, frame, T, equations);
    equations->AddScaled(TextureEquations(appearance, frame, image, T, params), 1.0);
    if (prior) AddPrior(*prior, T, equations);
    HoldWhatSlides(T, equations);
  });
}

DenseFit FitDensely(const Appearance& appearance, const rgbd::Frame& frame, const SmoothImage* image,
                    const geometry::Rigid& T_camera_object, const DenseParams& params, int iterations) {
  DenseFit fit;
  fit.T_camera_object = T_camera_object;
  bool settled = false;
  for (int iteration = 0;; ++iteration) {
    NormalEquations equations = TextureEquations(appearance, frame, image, fit.T_camera_object, params);
    fit.texture_samples = equations.samples;
    for (const SurfacePoint& sample : appearance.surface) AddSurface(sample, frame, fit.T_camera_object, &equations);
    fit.samples = equations.samples - fit.texture_samples;
    fit.information = equations.hessian;
    if (settled || iteration == iterations) {
      fit.likeness = LikenessOf(appearance, frame, image, fit.T_camera_object);
      fit.agreement = AgreementOf(appearance.surface, frame, fit.T_camera_object);
    }
    if (settled || iteration == iterations || equations.samples < 6) return fit;
    HoldWhatSlides(fit.T_camera_object, &equations);
    const Vector6d delta = -equations.hessian.ldlt().solve(equations.gradient);
    if (!delta.allFinite()) return fit;
    fit.T_camera_object = Perturbed(fit.T_camera_object, delta);
    settled = delta.norm() < kSmallestStep;
  }
}

}  // namespace vantage::pose
