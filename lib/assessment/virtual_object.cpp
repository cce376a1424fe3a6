#include "assessment/virtual_object.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <stdexcept>

#include "geometry/rigid.h"
#include "rendering/scene.h"

namespace vantage::assessment {
namespace {

constexpr int kMarginPx = 40;              // Background around the object: room for descriptors and for being mistaken.
constexpr int kMaxMeshVertices = 15000;    // The texture keeps its full resolution; only the surface is thinned.
constexpr std::size_t kMaxViews = 4;       // Keyframes one image is made of.
constexpr double kWorthwhileShare = 0.01;  // Of the image so far: a keyframe that adds less is the last.
constexpr double kInFrontM = 0.015;        // A surface this much nearer hides one already drawn (noise stays behind).
constexpr double kMinSourceCosine = 0.17;  // Surface the keyframe saw at more than 80 degrees is smeared: as good as unknown.
constexpr double kMinCosine = 0.05;        // Likewise for the virtual camera.

// The depth (CV_16UC1) with pixels of the mask that have none at the mean of those around them that do: depth registered to the
// colours of a near object has holes all over, and none along the object's outline.
cv::Mat WithoutHoles(const cv::Mat& depth, const cv::Mat& mask) {
  constexpr int kReach = 9;          // Pixels.
  constexpr double kMinKnown = 0.1;  // Of the pixels within reach.
  constexpr int kPasses = 3;
  cv::Mat filled = depth.clone();
  for (int pass = 0; pass < kPasses; ++pass) {
    cv::Mat known, sum, share, mean;
    cv::Mat((filled > 0) & (mask > 0)).convertTo(known, CV_32F, 1.0 / 255.0);
    filled.convertTo(sum, CV_32F);
    cv::blur(sum.mul(known), sum, {kReach, kReach});
    cv::blur(known, share, {kReach, kReach});
    cv::Mat(sum / share).convertTo(mean, CV_16U);
    mean.copyTo(filled, (filled == 0) & (mask > 0) & (share >= kMinKnown));
  }
  return filled;
}

// The mean of what is known (CV_32F, 0 or 1) of `values` (CV_32FC3, zero elsewhere) around every pixel.
cv::Mat MeanOfKnown(const cv::Mat& values, const cv::Mat& known, int reach) {
  cv::Mat sum, share;
  cv::blur(values, sum, {reach, reach});
  cv::blur(known, share, {reach, reach});
  cv::merge(std::vector<cv::Mat>(3, cv::max(share, 1e-6)), share);
  return sum / share;
}

// Unit normals of the keyframe's depth (without holes), camera coordinates, facing the camera; zero where unknown. CV_32FC3.
cv::Mat NormalMap(const rgbd::Frame& whole, const cv::Mat& mask) {
  const int step = 3;  // Pixels to either side: depth is quantised.
  const cv::Mat cloud = rgbd::OrganisedCloud(whole);
  cv::Mat normals(cloud.size(), CV_32FC3, cv::Scalar::all(0));
  const auto inside = [&](int x, int y) {
    return x >= 0 && y >= 0 && x < cloud.cols && y < cloud.rows && mask.at<std::uint8_t>(y, x);
  };
  const auto difference = [&](int x, int y, int dx, int dy) {
    // Central where both sides are on the object, else one-sided; NaN marks none.
    const int xa = inside(x - dx, y - dy) ? x - dx : x, ya = inside(x - dx, y - dy) ? y - dy : y;
    const int xb = inside(x + dx, y + dy) ? x + dx : x, yb = inside(x + dx, y + dy) ? y + dy : y;
    return cloud.at<cv::Vec3f>(yb, xb) - cloud.at<cv::Vec3f>(ya, xa);
  };
  for (int y = 0; y < cloud.rows; ++y) {
    for (int x = 0; x < cloud.cols; ++x) {
      if (!inside(x, y)) continue;
      cv::Vec3f normal = difference(x, y, step, 0).cross(difference(x, y, 0, step));
      const float norm = static_cast<float>(cv::norm(normal));
      if (!(norm > 0.f)) continue;
      if (normal.dot(cloud.at<cv::Vec3f>(y, x)) > 0.f) normal = -normal;
      normals.at<cv::Vec3f>(y, x) = normal * (1.f / norm);
    }
  }
  return normals;
}

// The normals as light is to fall on them: without the depth's noise. Object coordinates, about unit length; zero off the mask.
cv::Mat SmoothNormals(const cv::Mat& normals, const cv::Mat& mask, const Eigen::Matrix3d& R_object_camera) {
  constexpr int kReach = 13;  // Pixels.
  cv::Mat known, smooth;
  mask.convertTo(known, CV_32F, 1.0 / 255.0);
  smooth = MeanOfKnown(MeanOfKnown(normals, known, kReach), cv::Mat::ones(mask.size(), CV_32F), kReach);
  const Eigen::Matrix3f R = R_object_camera.cast<float>();
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) {
      cv::Vec3f& n = smooth.at<cv::Vec3f>(y, x);
      const Eigen::Vector3f turned = R * Eigen::Vector3f(n[0], n[1], n[2]);
      const float norm = turned.norm();
      n = mask.at<std::uint8_t>(y, x) && norm > 0.f ? cv::Vec3f(turned.x(), turned.y(), turned.z()) / norm : cv::Vec3f::all(0);
    }
  }
  return smooth;
}

// Gaps of a few pixels, where no keyframe saw the surface well, get the mean of what is around them: what is behind the object
// would shine through.
void CloseGaps(VirtualImage* image) {
  constexpr int kReach = 7;  // Pixels.
  cv::Mat closed;
  cv::morphologyEx(image->mask, closed, cv::MORPH_CLOSE, cv::getStructuringElement(cv::MORPH_ELLIPSE, {kReach, kReach}));
  const cv::Mat gaps = closed & ~image->mask;
  if (cv::countNonZero(gaps) == 0) return;
  cv::Mat known, colors, mean;
  image->mask.convertTo(known, CV_32F, 1.0 / 255.0);
  image->color.convertTo(colors, CV_32FC3);
  MeanOfKnown(colors, known, kReach).convertTo(mean, CV_8UC3);
  mean.copyTo(image->color, gaps);
  MeanOfKnown(image->normals, known, kReach).copyTo(image->normals, gaps);
  image->mask |= gaps;
}

int MeshStep(const cv::Mat& mask) {
  return std::max(1, static_cast<int>(std::ceil(std::sqrt(cv::countNonZero(mask) / static_cast<double>(kMaxMeshVertices)))));
}

}  // namespace

struct VirtualObject::Surface {
  rendering::Scene scene;  // Object coordinates.
  cv::Mat normals;         // Keyframe's camera.
  cv::Mat smooth_normals;  // Object coordinates.
  const model::View* view = nullptr;

  // The keyframe's pixel that shows this point, if it saw the surface there well and a camera at that place sees the same side of
  // it.
  std::optional<cv::Point> Shows(const Eigen::Vector3d& point_in_object, const Eigen::Vector3d& camera_in_object) const {
    const Eigen::Vector3d point = view->T_camera_object * point_in_object;
    const auto projected = view->keyframe.camera.Project(point);
    if (!projected) return std::nullopt;
    const cv::Point pixel(static_cast<int>(std::lround(projected->x())), static_cast<int>(std::lround(projected->y())));
    if (!cv::Rect({0, 0}, normals.size()).contains(pixel)) return std::nullopt;
    const cv::Vec3f& n = normals.at<cv::Vec3f>(pixel);
    const Eigen::Vector3d normal(n[0], n[1], n[2]);
    if (-normal.dot(point.normalized()) < kMinSourceCosine) return std::nullopt;
    if (normal.dot((view->T_camera_object * camera_in_object - point).normalized()) <= kMinCosine) return std::nullopt;
    return pixel;
  }
};

geometry::Rigid VirtualCameraPose(const model::View& view, const VirtualPose& pose) {
  const Eigen::Vector3d origin = view.T_camera_object.translation();
  const double distance = origin.norm() / std::exp2(pose.log2_scale);
  const Eigen::Vector3d axis(std::cos(pose.tilt_rad), std::sin(pose.tilt_rad), 0.0);
  geometry::Rigid T = geometry::Rigid::Identity();
  T.linear() = Eigen::AngleAxisd(pose.roll_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix() *
               Eigen::AngleAxisd(pose.rotation_rad, axis).toRotationMatrix() *
               Eigen::Quaterniond::FromTwoVectors(origin, Eigen::Vector3d::UnitZ()).toRotationMatrix() *
               view.T_camera_object.linear();
  T.translation() = Eigen::Vector3d(0.0, 0.0, distance);
  return T;
}

VirtualObject::VirtualObject(const model::ObjectModel& object) : object_(object) {
  std::vector<Eigen::Vector3d> outline;
  for (const model::View& view : object.views) {
    surfaces_.push_back(nullptr);
    if (view.keyframe.depth.empty() || view.mask.empty()) continue;
    rgbd::Frame whole = view.keyframe;
    whole.depth = WithoutHoles(whole.depth, view.mask);
    auto mesh = std::make_shared<rendering::Mesh>(
        rendering::MeshFromFrame(whole, view.mask, view.T_camera_object.inverse(), MeshStep(view.mask)));
    if (mesh->triangles.empty()) continue;
    const std::size_t stride = std::max<std::size_t>(1, mesh->vertices.size() / 200);
    for (std::size_t i = 0; i < mesh->vertices.size(); i += stride) outline.push_back(mesh->vertices[i].cast<double>());
    auto surface = std::make_unique<Surface>();
    surface->scene.Add(std::move(mesh), geometry::Rigid::Identity());
    surface->normals = NormalMap(whole, view.mask);
    surface->smooth_normals = SmoothNormals(surface->normals, view.mask, view.T_camera_object.linear().transpose());
    surface->view = &view;
    surfaces_.back() = std::move(surface);
  }
  outline_.resize(3, static_cast<Eigen::Index>(outline.size()));
  for (std::size_t i = 0; i < outline.size(); ++i) outline_.col(static_cast<Eigen::Index>(i)) = outline[i];
}

VirtualObject::~VirtualObject() = default;

geometry::PinholeCamera VirtualObject::Window(int view, const geometry::Rigid& T_camera_object, int max_width,
                                              int max_height) const {
  geometry::PinholeCamera camera = object_.views.at(static_cast<std::size_t>(view)).keyframe.camera;
  camera.cx = camera.cy = 0.0;
  Eigen::Vector2d lower = Eigen::Vector2d::Constant(1e9), upper = -lower;
  for (Eigen::Index i = 0; i < outline_.cols(); ++i) {
    const auto pixel = camera.Project(T_camera_object * outline_.col(i));
    if (!pixel) continue;
    lower = lower.cwiseMin(*pixel);
    upper = upper.cwiseMax(*pixel);
  }
  camera.width = max_width;
  camera.height = max_height;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  if (upper.x() >= lower.x()) {
    camera.width = static_cast<int>(std::min<double>(max_width, std::ceil(upper.x() - lower.x()) + 2 * kMarginPx));
    camera.height = static_cast<int>(std::min<double>(max_height, std::ceil(upper.y() - lower.y()) + 2 * kMarginPx));
    centre = 0.5 * (lower + upper);
  }
  camera.cx = 0.5 * camera.width - centre.x();
  camera.cy = 0.5 * camera.height - centre.y();
  return camera;
}

VirtualImage VirtualObject::Render(const geometry::PinholeCamera& camera, const geometry::Rigid& T_camera_object) const {
  const geometry::Rigid T_object_camera = T_camera_object.inverse();
  const Eigen::Vector3d direction = geometry::ViewDirection(T_camera_object);

  std::vector<std::pair<double, int>> order;
  for (int i = 0; i < static_cast<int>(surfaces_.size()); ++i) {
    if (!surfaces_[i]) continue;
    const double angle = geometry::AngleBetween(direction, geometry::ViewDirection(object_.views[i].T_camera_object));
    if (angle < M_PI_2) order.emplace_back(angle, i);
  }
  std::sort(order.begin(), order.end());
  if (order.size() > kMaxViews) order.resize(kMaxViews);

  rendering::RenderParams params;
  params.shaded = false;
  VirtualImage result{cv::Mat(camera.height, camera.width, CV_8UC3, cv::Scalar::all(0)),
                      cv::Mat(camera.height, camera.width, CV_8UC1, cv::Scalar(0)),
                      cv::Mat(camera.height, camera.width, CV_32FC3, cv::Scalar::all(0))};
  cv::Mat depth(camera.height, camera.width, CV_32FC1, cv::Scalar(1e9));
  int shown = 0;
  for (const auto& [angle, i] : order) {
    const Surface& surface = *surfaces_[i];
    int added = 0;
    const rendering::Image image = surface.scene.Render(camera, T_object_camera, params);
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const float z = image.depth.at<float>(y, x);
        if (!(z > 0.f) || z > depth.at<float>(y, x) - kInFrontM) continue;
        const Eigen::Vector3d point = T_object_camera * camera.Unproject({x, y}, z);
        const auto source = surface.Shows(point, T_object_camera.translation());
        if (!source) continue;
        depth.at<float>(y, x) = z;
        result.normals.at<cv::Vec3f>(y, x) = surface.smooth_normals.at<cv::Vec3f>(*source);
        result.color.at<cv::Vec3b>(y, x) = image.color.at<cv::Vec3b>(y, x);
        result.mask.at<std::uint8_t>(y, x) = 255;
        ++added;
      }
    }
    shown += added;
    if (added > 0 && added < kWorthwhileShare * shown) break;  // The next ones are farther off and would add less.
  }
  CloseGaps(&result);
  return result;
}

void Relight(const Light& before, const Light& after, VirtualImage* image) {
  const auto falls = [](const Light& light, const Eigen::Vector3d& normal) {
    return light.ambient + (1.0 - light.ambient) * std::max(0.0, light.to_lamp.dot(normal));
  };
  for (int y = 0; y < image->color.rows; ++y) {
    for (int x = 0; x < image->color.cols; ++x) {
      const cv::Vec3f& n = image->normals.at<cv::Vec3f>(y, x);
      if (!image->mask.at<std::uint8_t>(y, x) || n == cv::Vec3f::all(0)) continue;
      const Eigen::Vector3d normal(n[0], n[1], n[2]);
      const double ratio = falls(after, normal) / std::max(1e-3, falls(before, normal));
      cv::Vec3b& pixel = image->color.at<cv::Vec3b>(y, x);
      for (int k = 0; k < 3; ++k) pixel[k] = cv::saturate_cast<std::uint8_t>(ratio * pixel[k]);
    }
  }
}

cv::Mat Paste(const VirtualImage& object, const cv::Mat& background) {
  if (background.cols < object.color.cols || background.rows < object.color.rows || background.type() != CV_8UC3) {
    throw std::invalid_argument("Paste: the background must be CV_8UC3 and at least as large as the object's image");
  }
  cv::Mat alpha;
  cv::GaussianBlur(object.mask, alpha, cv::Size(3, 3), 0.7);
  cv::Mat image = background(cv::Rect(0, 0, object.color.cols, object.color.rows)).clone();
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const int a = object.mask.at<std::uint8_t>(y, x) ? alpha.at<std::uint8_t>(y, x) : 0;
      cv::Vec3b& pixel = image.at<cv::Vec3b>(y, x);
      const cv::Vec3b& over = object.color.at<cv::Vec3b>(y, x);
      for (int k = 0; k < 3; ++k) pixel[k] = static_cast<std::uint8_t>((a * over[k] + (255 - a) * pixel[k] + 127) / 255);
    }
  }
  return image;
}

void Disturb(const Disturbance& disturbance, std::uint32_t seed, cv::Mat* image) {
  cv::Mat table(1, 256, CV_8UC1);
  for (int i = 0; i < 256; ++i) {
    const double value = 255.0 * disturbance.brightness * std::pow(i / 255.0, disturbance.gamma);
    table.at<std::uint8_t>(i) = cv::saturate_cast<std::uint8_t>(value);
  }
  cv::LUT(*image, table, *image);
  if (disturbance.blur_px > 0.0) cv::GaussianBlur(*image, *image, cv::Size(), disturbance.blur_px);
  if (disturbance.image_noise > 0.0) {
    // The same in all channels, so that sigma is what the grey image has.
    cv::RNG random(seed);
    cv::Mat noise(image->size(), CV_16SC1), noise3, sum;
    random.fill(noise, cv::RNG::NORMAL, 0.0, disturbance.image_noise);
    cv::merge(std::vector<cv::Mat>(3, noise), noise3);
    image->convertTo(sum, CV_16SC3);
    sum += noise3;
    sum.convertTo(*image, CV_8UC3);
  }
}

cv::Mat WithoutObject(const cv::Mat& color, const cv::Mat& mask) {
  if (color.type() != CV_8UC3 || mask.type() != CV_8UC1 || color.size() != mask.size()) {
    throw std::invalid_argument("WithoutObject: expected CV_8UC3 colour and a CV_8UC1 mask of the same size");
  }
  cv::Mat grown;
  cv::dilate(mask != 0, grown, cv::getStructuringElement(cv::MORPH_ELLIPSE, {15, 15}));
  const cv::Rect box = cv::boundingRect(grown);
  if (box.area() == 0) return color.clone();
  // Slide a window of the same size over the image; take the place with the least of the object, the nearest of those.
  cv::Mat counts;
  cv::integral(grown / 255, counts, CV_32S);
  cv::Point best;
  long best_cost = -1;
  for (int y = 0; y + box.height <= color.rows; y += 4) {
    for (int x = 0; x + box.width <= color.cols; x += 4) {
      const int covered = counts.at<int>(y, x) + counts.at<int>(y + box.height, x + box.width) - counts.at<int>(y, x + box.width) -
                          counts.at<int>(y + box.height, x);
      const long cost = 100000L * covered + std::abs(x - box.x) + std::abs(y - box.y);
      if (best_cost < 0 || cost < best_cost) {
        best_cost = cost;
        best = {x, y};
      }
    }
  }
  cv::Mat result = color.clone();
  color(cv::Rect(best, box.size())).copyTo(result(box), grown(box));
  // Where even the best place showed some of the object, no texture at all is better than its own.
  if (best_cost >= 100000L) {
    cv::Mat left(grown.size(), CV_8UC1, cv::Scalar(0));
    grown(cv::Rect(best, box.size())).copyTo(left(box), grown(box));
    result.setTo(cv::mean(color, grown == 0), left);
  }
  return result;
}

}  // namespace vantage::assessment
