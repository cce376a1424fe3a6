#include "vantage/feature_trial.h"

#include <chrono>
#include <cstdio>
#include <ctime>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "learning/keyframe.h"
#include "session/judge.h"
#include "vantage/sequence.h"

namespace vantage::cli {
namespace {

constexpr double kRight_m = 0.04, kNear_m = 0.01;  // Mean point distance.
constexpr double kDetected = 0.5;                  // p(o|c).
constexpr double kMinShareInImage = 0.5;
constexpr int kMinViewPoints = 20;
constexpr int kLabelBorder = 3;   // Pixels of the label's border that are not learned: edges against the background.
constexpr int kSurfaceStep = 12;  // Every so manieth pixel of every so manieth row is a point of the true surface.
const char* const kName = "object";

// Milliseconds, by the clock on the wall and of the processor (all cores).
class Timer {
 public:
  double Wall() const { return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - wall_).count(); }
  double Cpu() const { return 1000.0 * static_cast<double>(std::clock() - cpu_) / CLOCKS_PER_SEC; }

 private:
  std::chrono::steady_clock::time_point wall_ = std::chrono::steady_clock::now();
  std::clock_t cpu_ = std::clock();
};

// What the trial knows of the recording.
struct Recording {
  const rgbd::BopScene& scene;
  int object_id;
  int label;

  cv::Mat Mask(int id) const { return scene.LoadLabel(id) == label; }
  std::optional<geometry::Rigid> Truth(int id) const { return TruthOf(scene, id, object_id); }
};

// Of all frames' labels, mesh coordinates.
Eigen::Matrix3Xd TrueSurface(const Recording& recording, const std::vector<int>& ids) {
  std::vector<Eigen::Vector3d> points;
  for (const int id : ids) {
    const auto T_camera_mesh = recording.Truth(id);
    if (!T_camera_mesh) continue;
    const rgbd::Frame frame = recording.scene.Load(id);
    const cv::Mat mask = recording.Mask(id);
    for (int y = 0; y < mask.rows && !frame.depth.empty(); y += kSurfaceStep) {
      for (int x = 0; x < mask.cols; x += kSurfaceStep) {
        if (mask.at<uchar>(y, x) == 0) continue;
        if (const auto point = rgbd::PointAt(frame, {x, y})) points.push_back(T_camera_mesh->inverse() * *point);
      }
    }
  }
  if (points.empty()) {
    throw std::runtime_error(recording.scene.folder().string() + ": no frame has depth on object " +
                             std::to_string(recording.object_id) + "; the comparison needs a recording with depth and labels");
  }
  return Eigen::Map<const Eigen::Matrix3Xd>(points[0].data(), 3, static_cast<Eigen::Index>(points.size()));
}

model::ObjectModel LearnViews(const Recording& recording, const std::vector<int>& ids, const features::FeatureParams& params) {
  model::ObjectModel object;
  object.name = kName;
  object.feature_fingerprint = params.Fingerprint();
  for (const int id : ids) {
    const auto T_camera_mesh = recording.Truth(id);
    cv::Mat mask = recording.Mask(id);
    cv::erode(mask, mask, cv::Mat(), cv::Point(-1, -1), kLabelBorder);
    if (!T_camera_mesh || cv::countNonZero(mask) == 0) continue;
    const rgbd::Frame frame = recording.scene.Load(id);
    const features::Features features = features::Extract(rgbd::Gray(frame), mask, params);
    auto extended = learning::WithView(object, frame, mask, features, *T_camera_mesh, {}, kMinViewPoints);
    if (extended) object = std::move(*extended);
  }
  return object;
}

void JudgeFrame(const std::vector<recognition::Detection>& detections, const Eigen::Matrix3Xd& surface,
                const std::optional<geometry::Rigid>& truth, bool visible, FeatureFigures& figures) {
  double nearest_m = 1e9, nearest_detected_m = 1e9;
  for (const recognition::Detection& detection : detections) {
    const double distance_m = truth ? model::MeanPointDistance(surface, detection.T_camera_object, *truth) : 1e9;
    nearest_m = std::min(nearest_m, distance_m);
    if (detection.probability < kDetected) continue;
    nearest_detected_m = std::min(nearest_detected_m, distance_m);
    figures.wrong += distance_m >= kRight_m;
  }
  if (!visible) return;
  ++figures.frames;
  figures.found += nearest_m < kRight_m;
  figures.found_10mm += nearest_m < kNear_m;
  figures.right += nearest_detected_m < kRight_m;
  figures.right_10mm += nearest_detected_m < kNear_m;
}

std::vector<recognition::Detection> RecogniseTimed(const recognition::Recogniser& recogniser, const rgbd::Frame& frame,
                                                   FeatureFigures& figures) {
  const Timer timer;
  const features::Features features = recogniser.Extract(frame);
  figures.extract_ms.push_back(timer.Wall());
  figures.extract_cpu_ms.push_back(timer.Cpu());
  auto detections = recogniser.Recognise(frame, features);
  figures.whole_ms.push_back(timer.Wall());
  figures.whole_cpu_ms.push_back(timer.Cpu());
  figures.points.push_back(features.size());
  return detections;
}

}  // namespace

FeatureSetting ParseFeatureSetting(const std::string& text) {
  FeatureSetting setting;
  setting.name = text;
  char type[16] = "", rest[2] = "";
  const int read = std::sscanf(text.c_str(), "%15[a-z]:%d:%lf%1s", type, &setting.features.max_keypoints,
                               &setting.features.contrast_threshold, rest);
  if (read != 3) {
    throw std::runtime_error("--features: expected TYPE:MAX_KEYPOINTS:CONTRAST, as sift:3000:0.02; found " + text);
  }
  setting.features.type = type;
  setting.features.Check();
  return setting;
}

std::vector<FeatureFigures> TryFeatures(const rgbd::BopScene& scene, const std::vector<int>& ids, int object_id, int folds,
                                        const std::vector<FeatureSetting>& settings,
                                        const recognition::RecogniserParams& recogniser_params) {
  const auto label = LabelOfObject(scene, object_id);
  if (!label) throw std::runtime_error(scene.folder().string() + ": has no label/; the comparison needs it");
  const Recording recording{scene, object_id, *label};
  const Eigen::Matrix3Xd surface = TrueSurface(recording, ids);
  std::vector<FeatureFigures> figures(settings.size());
  for (int fold = 0; fold < folds; ++fold) {
    std::vector<int> learned, asked;
    for (std::size_t i = 0; i < ids.size(); ++i) (static_cast<int>(i) % folds == fold ? asked : learned).push_back(ids[i]);
    std::vector<std::unique_ptr<recognition::Recogniser>> recognisers;
    for (std::size_t s = 0; s < settings.size(); ++s) {
      recognition::RecogniserParams params = recogniser_params;
      params.features = settings[s].features;
      params.use_query_depth = false;
      recognisers.push_back(std::make_unique<recognition::Recogniser>(params));
      auto object = std::make_shared<model::ObjectModel>(LearnViews(recording, learned, params.features));
      figures[s].views += static_cast<int>(object->views.size());
      for (const model::View& view : object->views) figures[s].view_points += view.features.size();
      if (!object->views.empty()) recognisers.back()->Set(object);
    }
    for (const int id : asked) {
      rgbd::Frame frame = scene.Load(id);
      frame.depth = cv::Mat();
      frame.T_world_camera.reset();
      const auto truth = recording.Truth(id);
      const bool visible = truth && session::ShareInImage(surface, *truth, frame.camera) >= kMinShareInImage;
      for (std::size_t s = 0; s < settings.size(); ++s) {
        JudgeFrame(RecogniseTimed(*recognisers[s], frame, figures[s]), surface, truth, visible, figures[s]);
      }
    }
  }
  return figures;
}

}  // namespace vantage::cli
