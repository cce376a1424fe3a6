#include "vantage/feature_trial.h"

#include <algorithm>
#include <cctype>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <memory>
#include <stdexcept>

#include "rgbd/codec.h"
#include "session/judge.h"
#include "vantage/known_views.h"

namespace vantage::cli {
namespace {

constexpr double kRight_m = 0.04, kNear_m = 0.01;  // Mean point distance.
constexpr double kDetected = 0.5;                  // p(o|c).
constexpr double kMinShareInImage = 0.5;

// Milliseconds, by the clock on the wall and of the processor (all cores).
class Timer {
 public:
  double Wall() const { return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - wall_).count(); }
  double Cpu() const { return 1000.0 * static_cast<double>(std::clock() - cpu_) / CLOCKS_PER_SEC; }

 private:
  std::chrono::steady_clock::time_point wall_ = std::chrono::steady_clock::now();
  std::clock_t cpu_ = std::clock();
};

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

// The recording as it comes over the bus.
class CodedObject : public RecordedObject {
 public:
  CodedObject(const RecordedObject& object, int jpeg_quality) : RecordedObject(object), jpeg_quality_(jpeg_quality) {}

  rgbd::Frame Load(int id) const override { return Load(id, nullptr); }
  rgbd::Frame Load(int id, std::vector<double>* coded_kb) const {
    rgbd::Frame frame = RecordedObject::Load(id);
    if (jpeg_quality_ == 0) return frame;
    const rgbd::Bytes bytes = rgbd::EncodeColor(frame.color, jpeg_quality_);
    if (coded_kb) coded_kb->push_back(1e-3 * static_cast<double>(bytes.size()));
    frame.color = rgbd::DecodeColor(bytes);
    return frame;
  }

 private:
  int jpeg_quality_;
};

}  // namespace

FeatureSetting ParseFeatureSetting(const std::string& text) {
  FeatureSetting setting;
  setting.name = text;
  char type[16] = "", rest[2] = "";
  const int read = std::sscanf(text.c_str(), "%15[a-z]:%d:%lf:%d%1s", type, &setting.features.max_keypoints,
                               &setting.features.contrast_threshold, &setting.jpeg_quality, rest);
  const bool whole = read == 4 || (read == 3 && std::count(text.begin(), text.end(), ':') == 2 && std::isdigit(text.back()));
  if (!whole || setting.jpeg_quality < 0 || setting.jpeg_quality > 100) {
    throw std::runtime_error("--features: expected TYPE:MAX_KEYPOINTS:CONTRAST[:JPEG_QUALITY], as sift:3000:0.02:92; found " +
                             text);
  }
  setting.features.type = type;
  setting.features.Check();
  return setting;
}

std::vector<FeatureFigures> TryFeatures(const rgbd::BopScene& scene, const std::vector<int>& ids, int object_id, int folds,
                                        const std::vector<FeatureSetting>& settings,
                                        const recognition::RecogniserParams& recogniser_params) {
  const RecordedObject known(scene, object_id);
  const Eigen::Matrix3Xd surface = known.Surface(ids);
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
      const CodedObject coded(known, settings[s].jpeg_quality);
      auto object = std::make_shared<model::ObjectModel>(coded.Learn(learned, params.features));
      figures[s].views += static_cast<int>(object->views.size());
      for (const model::View& view : object->views) figures[s].view_points += view.features.size();
      if (!object->views.empty()) recognisers.back()->Set(object);
    }
    for (const int id : asked) {
      const auto truth = known.TruePose(id);
      for (std::size_t s = 0; s < settings.size(); ++s) {
        rgbd::Frame frame = CodedObject(known, settings[s].jpeg_quality).Load(id, &figures[s].coded_kb);
        frame.depth = cv::Mat();
        frame.T_world_camera.reset();
        const bool visible = truth && session::ShareInImage(surface, *truth, frame.camera) >= kMinShareInImage;
        JudgeFrame(RecogniseTimed(*recognisers[s], frame, figures[s]), surface, truth, visible, figures[s]);
      }
    }
  }
  return figures;
}

}  // namespace vantage::cli
