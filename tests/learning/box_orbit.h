// A made-up learning session: a box on a table, once round, with a drift as trackers have, and the truth beside it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <opencv2/core.hpp>
#include <random>
#include <vector>

#include "learning/keyframe.h"

namespace vantage::testing {

class Random {
 public:
  explicit Random(std::uint32_t seed) : random_(seed) {}
  double Uniform(double low, double high) { return low + (high - low) * (random_() / 4294967296.0); }
  double Normal() { return std::sqrt(-2.0 * std::log(Uniform(1e-12, 1.0))) * std::cos(Uniform(0.0, 2.0 * M_PI)); }
  Eigen::Vector3d Normal3() { return {Normal(), Normal(), Normal()}; }

 private:
  std::mt19937 random_;
};

struct BoxOrbitOptions {
  int views = 36;
  double turn_deg = 350.0;  // From the first view to the last.
  int points_per_side = 120;
  bool same_print = false;    // All four sides wear the same picture.
  double drift_m = 0.0010;    // Per view.
  double drift_deg = 0.2;     // Per view, in one direction.
  double wrong_links = 0.03;  // Share of the links that are to another point near by.
  std::uint32_t seed = 1;
};

class BoxOrbit {
 public:
  explicit BoxOrbit(const BoxOrbitOptions& options) : options_(options), random_(options.seed) {
    for (int side = 0; side < 4; ++side) PaintSide(side);
    object_.name = "box";
    for (int v = 0; v < options.views; ++v) AddView(v * options.turn_deg / (options.views - 1) * M_PI / 180.0);
  }

  const model::ObjectModel& object() const { return object_; }
  const std::vector<geometry::Rigid>& truth() const { return truth_; }  // T_camera_object of every view.

  // One more view from there (azimuth), tracked like the others: placed by the drift so far, linked to the last three.
  void AddView(double azimuth_rad) {
    const geometry::Rigid T = PoseAt(azimuth_rad);
    const geometry::Rigid estimate = T * NextDrift();
    rgbd::Frame frame;
    cv::Mat mask;
    Look(T, &frame, &mask);
    const std::vector<int> seen = Seen(T);
    features::Features features;
    std::vector<recognition::GuidedMatch> links;
    for (const int p : seen) {
      const Eigen::Vector2d pixel =
          *kCamera.Project(T * paint_[p].position) + 0.4 * Eigen::Vector2d(random_.Normal(), random_.Normal());
      const int keypoint = features.size();
      features.keypoints.emplace_back(pixel.x(), pixel.y(), 6.f);
      features.descriptors.push_back(Described(paint_[p].descriptor));
      const int known = KnownAs(p);
      if (known >= 0) links.push_back({keypoint, 0, 0, known});
    }
    for (size_t i = 0; i + 1 < links.size(); ++i) {
      if (random_.Uniform(0, 1) < options_.wrong_links) std::swap(links[i].point, links[i + 1].point);
    }
    auto extended = learning::WithView(object_, frame, mask, features, estimate, links, 4);
    object_ = std::move(*extended);
    truth_.push_back(T);
    RememberPoints(seen, features);
  }

  double ErrorOfView(const model::ObjectModel& object, int view) const {
    return geometry::Difference(object.views[view].T_camera_object, truth_[view]).translation_m;
  }
  double TurnOfViewDeg(const model::ObjectModel& object, int view) const {
    return geometry::Difference(object.views[view].T_camera_object, truth_[view]).rotation_rad * 180.0 / M_PI;
  }
  // Median distance of the model's points from the box's sides and top.
  static double MedianOffSurface(const model::ObjectModel& object) {
    std::vector<double> distances;
    for (const model::ModelPoint& point : object.points) {
      const Eigen::Vector3d beyond = point.position.cwiseAbs() - HalfSize();
      distances.push_back(beyond.maxCoeff() > 0 ? beyond.cwiseMax(0.0).norm() : -beyond.maxCoeff());
    }
    std::nth_element(distances.begin(), distances.begin() + distances.size() / 2, distances.end());
    return distances[distances.size() / 2];
  }

  static Eigen::Vector3d HalfSize() { return {0.06, 0.06, 0.09}; }
  static geometry::Rigid PoseAt(double azimuth_rad) {
    const Eigen::Vector3d eye(0.6 * std::cos(azimuth_rad), 0.6 * std::sin(azimuth_rad), 0.3);
    return geometry::LookAt(eye, Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ()).inverse();
  }

 private:
  struct Paint {
    Eigen::Vector3d position;
    Eigen::Vector3d normal;
    cv::Mat descriptor;
  };

  cv::Mat RandomDescriptor(double length) {
    cv::Mat row(1, 128, CV_32F);
    for (int i = 0; i < 128; ++i) row.at<float>(i) = static_cast<float>(random_.Normal() * length / std::sqrt(128.0));
    return row;
  }
  cv::Mat Described(const cv::Mat& descriptor) {
    const cv::Mat noisy = descriptor + RandomDescriptor(0.3);
    return noisy / cv::norm(noisy);
  }

  void PaintSide(int side) {
    for (int i = 0; i < options_.points_per_side; ++i) {
      const Eigen::AngleAxisd turn(side * M_PI / 2, Eigen::Vector3d::UnitZ());
      const int model = options_.same_print && side > 0 ? i : -1;
      const Eigen::Vector3d flat = model >= 0
                                       ? paint_[model].position
                                       : Eigen::Vector3d(0.06, random_.Uniform(-0.055, 0.055), random_.Uniform(-0.085, 0.085));
      cv::Mat descriptor = model >= 0 ? paint_[model].descriptor : RandomDescriptor(1.0);
      paint_.push_back({turn * flat, turn * Eigen::Vector3d::UnitX(), descriptor / cv::norm(descriptor)});
    }
  }

  geometry::Rigid NextDrift() {
    if (!truth_.empty()) {
      geometry::Rigid step = geometry::Rigid::Identity();
      step.translation() = options_.drift_m * (Eigen::Vector3d(0.7, 0.4, 0.3) + 0.3 * random_.Normal3());
      step.rotate(Eigen::AngleAxisd(options_.drift_deg * M_PI / 180 * (1 + 0.3 * random_.Normal()),
                                    Eigen::Vector3d(0.3, 0.1, 0.9).normalized()));
      drift_ = drift_ * step;
    }
    return drift_;
  }

  std::vector<int> Seen(const geometry::Rigid& T) {
    std::vector<int> seen;
    for (int p = 0; p < static_cast<int>(paint_.size()); ++p) {
      const Eigen::Vector3d in_camera = T * paint_[p].position;
      const double cosine = -(T.linear() * paint_[p].normal).dot(in_camera.normalized());
      if (cosine > std::cos(60 * M_PI / 180) && random_.Uniform(0, 1) < 0.8) seen.push_back(p);
    }
    return seen;
  }

  // The model point under which one of the last three views knows a painted point, -1 where none does.
  int KnownAs(int paint) const {
    const auto found = known_.find(paint);
    return found != known_.end() && found->second.first + 3 >= static_cast<int>(truth_.size()) ? found->second.second : -1;
  }

  void RememberPoints(const std::vector<int>& seen, const features::Features& features) {
    const model::View& view = object_.views.back();
    size_t kept = 0;  // WithView leaves some out; descriptors tell which.
    for (size_t k = 0; k < seen.size() && kept < view.points.size(); ++k) {
      if (cv::norm(features.descriptors.row(static_cast<int>(k)), view.features.descriptors.row(static_cast<int>(kept)),
                   cv::NORM_INF) > 0)
        continue;
      known_[seen[k]] = {static_cast<int>(truth_.size()) - 1, view.points[kept++]};
    }
  }

  // Depth of the box and the table by rays, with noise; the mask of the box.
  void Look(const geometry::Rigid& T_camera_object, rgbd::Frame* frame, cv::Mat* mask) {
    frame->id = static_cast<int>(truth_.size());
    frame->camera = kCamera;
    frame->color = cv::Mat(kCamera.height, kCamera.width, CV_8UC3, cv::Scalar(90, 90, 90));
    frame->depth = cv::Mat::zeros(kCamera.height, kCamera.width, CV_16UC1);
    *mask = cv::Mat::zeros(kCamera.height, kCamera.width, CV_8UC1);
    const geometry::Rigid T_object_camera = T_camera_object.inverse();
    const Eigen::Vector3d eye = T_object_camera.translation();
    for (int y = 0; y < kCamera.height; ++y) {
      for (int x = 0; x < kCamera.width; ++x) {
        const Eigen::Vector3d ray = T_object_camera.linear() * kCamera.Unproject({x, y}, 1.0);
        double depth = ray.z() < 0 ? (-HalfSize().z() - eye.z()) / ray.z() : 0.0;
        const Eigen::Array3d to_low = (-HalfSize() - eye).array() / ray.array(), to_high = (HalfSize() - eye).array() / ray.array();
        const double enter = to_low.min(to_high).maxCoeff(), leave = to_low.max(to_high).minCoeff();
        if (enter > 0 && enter < leave) {
          depth = enter;
          mask->at<uchar>(y, x) = 255;
        }
        if (depth <= 0) continue;
        const double noise = (0.0012 + 0.0019 * (depth - 0.4) * (depth - 0.4)) * random_.Normal();
        frame->depth.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(std::lround(1000 * (depth + noise)));
      }
    }
  }

  static constexpr geometry::PinholeCamera kCamera{640, 480, 525, 525, 319.5, 239.5};
  BoxOrbitOptions options_;
  Random random_;
  std::vector<Paint> paint_;
  std::map<int, std::pair<int, int>> known_;  // Painted point -> view that saw it last, model point.
  geometry::Rigid drift_ = geometry::Rigid::Identity();
  model::ObjectModel object_;
  std::vector<geometry::Rigid> truth_;
};

}  // namespace vantage::testing
