#include "vantage/truth_judge.h"

#include <stdexcept>

#include "model/store.h"
#include "session/judge.h"
#include "vantage/sequence.h"

namespace vantage::cli {
namespace {

constexpr double kRight = 0.04;    // Metres.
constexpr double kDetected = 0.5;  // p(o|c).

}  // namespace

model::ObjectModel OnlyObjectOf(const std::string& store_file) {
  const model::Store store(store_file, model::Store::Mode::kRead);
  const auto objects = store.List();
  if (objects.size() != 1) {
    throw std::runtime_error(store_file + ": expected a store of one object, it holds " + std::to_string(objects.size()));
  }
  auto object = store.Load(objects[0].name);
  if (!object || object->views.empty()) throw std::runtime_error(store_file + ": '" + objects[0].name + "' has no views; learn it");
  return std::move(*object);
}

geometry::Rigid MeshFromObject(const rgbd::BopScene& scene, int object_id, const model::ObjectModel& object) {
  const model::View& first = object.views.at(0);
  const auto T_camera_mesh = TruthOf(scene, static_cast<int>(first.frame_id), object_id);
  if (!T_camera_mesh) {
    throw std::runtime_error(scene.folder().string() + ": no truth of object " + std::to_string(object_id) + " in frame " +
                             std::to_string(first.frame_id) + ", where " + object.name +
                             " was first learned; learn it from this recording");
  }
  return T_camera_mesh->inverse() * first.T_camera_object;
}

TruthJudge::TruthJudge(const rgbd::BopScene& scene, int object_id, const model::ObjectModel& object)
    : scene_(scene),
      object_id_(object_id),
      name_(object.name),
      points_(object.PointMatrix()),
      T_mesh_object_(MeshFromObject(scene, object_id, object)) {}

void TruthJudge::Add(const rgbd::Frame& frame, const std::vector<recognition::Detection>& detections) {
  const auto T_camera_mesh = TruthOf(scene_, static_cast<int>(frame.id), object_id_);
  const bool visible = T_camera_mesh && session::ShareInImage(points_, *T_camera_mesh * T_mesh_object_, frame.camera) >= 0.5;
  tally_.frames += visible;
  for (const recognition::Detection& detection : detections) {
    if (detection.object != name_ || detection.probability < kDetected) continue;
    ++tally_.detections;
    const double distance_m = T_camera_mesh
                                  ? model::MeanPointDistance(points_, detection.T_camera_object, *T_camera_mesh * T_mesh_object_)
                                  : std::numeric_limits<double>::infinity();
    tally_.wrong += distance_m >= kRight;
    tally_.right += visible && distance_m < kRight;
    tally_.right_10mm += visible && distance_m < 0.01;
  }
}

}  // namespace vantage::cli
