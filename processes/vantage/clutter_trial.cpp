#include "vantage/clutter_trial.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <random>
#include <stdexcept>

#include "learning/keyframe.h"
#include "model/store.h"
#include "session/judge.h"
#include "vantage/overlay.h"

namespace vantage::cli {
namespace {

constexpr int kMinViewPoints = 12;

class Dice {
 public:
  Dice(std::uint32_t seed, int a, int b)
      : random_(seed * 2654435761u + 40503u * static_cast<unsigned>(a) + static_cast<unsigned>(b)) {
    random_.discard(8);
  }
  double Uniform(double low, double high) { return low + (high - low) * (random_() / 4294967296.0); }
  int Below(int count) { return static_cast<int>((static_cast<std::uint64_t>(random_()) * count) >> 32); }

 private:
  std::mt19937 random_;
};

geometry::Rigid YawAt(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double yaw_rad) {
  geometry::Rigid T = geometry::Rigid::Identity();
  T.translate(Eigen::Vector3d(to.x(), to.y(), 0.0));
  T.rotate(Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()));
  T.translate(Eigen::Vector3d(-from.x(), -from.y(), 0.0));
  return T;
}

// Radius of the circle around a mesh's footprint.
double FootprintRadius(const rendering::Mesh& mesh) {
  Eigen::Vector3d lower, upper;
  rendering::Bounds(mesh, &lower, &upper);
  return 0.5 * (upper - lower).head<2>().norm();
}

geometry::Rigid CameraAround(const Eigen::Vector3d& target, double azimuth_rad, double elevation_rad, double distance_m) {
  const Eigen::Vector3d direction(std::cos(elevation_rad) * std::cos(azimuth_rad), std::cos(elevation_rad) * std::sin(azimuth_rad),
                                  std::sin(elevation_rad));
  return geometry::LookAt(target + distance_m * direction, target, Eigen::Vector3d::UnitZ());
}

}  // namespace

int ClutterFrame::right() const {
  return static_cast<int>(std::count_if(sightings.begin(), sightings.end(), [](const Sighting& s) { return s.right > 0; }));
}

ClutterTrial::ClutterTrial(const simulation::WorldParams& world, const recognition::RecogniserParams& recogniser,
                           const ClutterParams& params)
    : world_params_(world), params_(params), world_(world), recogniser_(recogniser) {
  for (const simulation::TrueObject& object : world_.Truth()) places_.push_back(object.T_world_object);
}

void ClutterTrial::Learn(const std::filesystem::path& store_file) {
  std::optional<model::Store> store;
  if (!store_file.empty()) store.emplace(store_file, model::Store::Mode::kWrite);
  for (int i = 0; i < objects(); ++i) {
    auto known = store ? store->Load(world_params_.objects[i].name) : std::nullopt;
    if (!known) {
      known = LearnObject(i);
      if (store) store->SaveObject(*known);
    }
    models_.push_back(std::make_shared<const model::ObjectModel>(std::move(*known)));
    recogniser_.Set(models_.back());
  }
}

// Alone on the table, from all sides, at known poses: the object's frame is the mesh's.
model::ObjectModel ClutterTrial::LearnObject(int object) {
  Arrange(0);
  for (int i = 0; i < objects(); ++i) world_.ShowObject(i, i == object);
  model::ObjectModel model;
  model.name = world_params_.objects[object].name;
  model.feature_fingerprint = recogniser_.params().features.Fingerprint();
  const simulation::TrueObject truth = world_.Truth()[object];
  const Eigen::Vector3d middle = truth.T_world_object * Eigen::Vector3d(truth.points.rowwise().mean());
  for (const double elevation_deg : params_.learning_elevations_deg) {
    for (int k = 0; k < params_.learning_azimuths; ++k) {
      const geometry::Rigid T_world_camera = CameraAround(middle, 2.0 * M_PI * k / params_.learning_azimuths,
                                                          elevation_deg * M_PI / 180.0, params_.learning_distance_m);
      rgbd::Frame frame = world_.Look(T_world_camera, params_.seed + 7919u * static_cast<unsigned>(model.views.size() + 1));
      frame.id = static_cast<std::int64_t>(model.views.size());
      frame.utime = frame.id;
      const cv::Mat mask = world_.Labels(T_world_camera) == object;
      const auto features = features::Extract(rgbd::Gray(frame), mask, recogniser_.params().features);
      auto extended =
          learning::WithView(model, frame, mask, features, T_world_camera.inverse() * truth.T_world_object, {}, kMinViewPoints);
      if (extended) model = std::move(*extended);
    }
  }
  for (int i = 0; i < objects(); ++i) world_.ShowObject(i, true);
  if (model.views.empty()) {
    throw std::runtime_error("object '" + model.name + "' of the world shows too few interest points to be learned");
  }
  return model;
}

// The world's own arrangement, or its objects at each other's places, shifted and turned, none within another.
void ClutterTrial::Arrange(int arrangement) {
  arrangement_ = arrangement;
  std::vector<int> place_of(places_.size());
  for (size_t i = 0; i < places_.size(); ++i) place_of[i] = static_cast<int>(i);
  Dice dice(params_.seed, arrangement, 0);
  if (arrangement > 0) {
    for (size_t i = place_of.size(); i > 1; --i) std::swap(place_of[i - 1], place_of[dice.Below(static_cast<int>(i))]);
  }
  std::vector<Eigen::Vector3d> standing;  // x, y, radius.
  for (int i = 0; i < objects(); ++i) {
    geometry::Rigid T = places_[i];
    if (arrangement > 0) {
      const Eigen::Vector2d from = places_[i].translation().head<2>();
      const double radius = FootprintRadius(world_.MeshOf(i));
      Eigen::Vector2d to = places_[place_of[i]].translation().head<2>();
      for (int attempt = 0; attempt < 100; ++attempt) {
        const Eigen::Vector2d shift(dice.Uniform(-1.0, 1.0), dice.Uniform(-1.0, 1.0));
        to = places_[place_of[i]].translation().head<2>() + params_.max_shift_m * shift;
        const bool free = std::none_of(standing.begin(), standing.end(), [&](const Eigen::Vector3d& other) {
          return (other.head<2>() - to).norm() < radius + other.z();
        });
        if (free) break;
      }
      standing.emplace_back(to.x(), to.y(), radius);
      T = YawAt(from, to, dice.Uniform(-1.0, 1.0) * params_.max_turn_deg * M_PI / 180.0) * T;
    }
    world_.MoveObject(i, T);
  }
}

geometry::Rigid ClutterTrial::CameraPose(int arrangement, int look) const {
  if (look == 0) return world_.StartPose();
  Dice dice(params_.seed, arrangement, look);
  const Eigen::Vector3d offset = world_params_.start_eye_m - world_params_.start_target_m;
  const double azimuth = std::atan2(offset.y(), offset.x()) + dice.Uniform(-35.0, 35.0) * M_PI / 180.0;
  const double elevation = dice.Uniform(18.0, 45.0) * M_PI / 180.0;
  return CameraAround(world_params_.start_target_m, azimuth, elevation, offset.norm() * dice.Uniform(0.9, 1.1));
}

// `labels`: of all objects from that pose.
double ClutterTrial::Occlusion(int object, const cv::Mat& labels, const geometry::Rigid& T_world_camera) {
  for (int i = 0; i < objects(); ++i) world_.ShowObject(i, i == object);
  const int alone = cv::countNonZero(world_.Labels(T_world_camera) == object);
  for (int i = 0; i < objects(); ++i) world_.ShowObject(i, true);
  return alone > 0 ? 1.0 - double(cv::countNonZero(labels == object)) / alone : 1.0;
}

ClutterFrame ClutterTrial::Look(int arrangement, int look, cv::Mat* overlay) {
  Arrange(arrangement);
  const geometry::Rigid T_world_camera = CameraPose(arrangement, look);
  const rgbd::Frame frame = world_.Look(T_world_camera, params_.seed + 1009u * arrangement + look);
  ClutterFrame result;
  result.arrangement = arrangement;
  result.look = look;
  const auto start = std::chrono::steady_clock::now();
  auto detections = recogniser_.Recognise(frame, recogniser_.Extract(frame));
  result.ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  detections.erase(std::remove_if(detections.begin(), detections.end(),
                                  [&](const recognition::Detection& d) { return d.probability < params_.detected; }),
                   detections.end());
  if (overlay) *overlay = DrawDetections(frame, detections);

  const cv::Mat labels = world_.Labels(T_world_camera);
  const std::vector<simulation::TrueObject> truth = world_.Truth();
  for (int i = 0; i < objects(); ++i) {
    const geometry::Rigid T_camera_object = T_world_camera.inverse() * truth[i].T_world_object;
    Sighting sighting;
    sighting.object = truth[i].name;
    sighting.judged = session::ShareInImage(truth[i].points, T_camera_object, frame.camera) >= params_.min_share_in_image;
    if (sighting.judged) sighting.occlusion = Occlusion(i, labels, T_world_camera);
    for (const recognition::Detection& detection : detections) {
      if (detection.object != truth[i].name) continue;
      const double distance_m = model::MeanPointDistance(truth[i].points, detection.T_camera_object, T_camera_object);
      ++(distance_m < params_.right_m ? sighting.right : sighting.wrong);
    }
    result.sightings.push_back(std::move(sighting));
  }
  return result;
}

}  // namespace vantage::cli
