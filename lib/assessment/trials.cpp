#include <algorithm>
#include <cmath>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <random>
#include <stdexcept>
#include <string>

#include "assessment/assessor.h"
#include "assessment/virtual_object.h"

namespace vantage::assessment {
namespace {

constexpr int kLevels = 8;  // Of noise and of blur (section VI).

// Draws that are the same with every standard library.
class Dice {
 public:
  Dice(std::uint32_t seed, int view, int trial) {
    std::seed_seq sequence{seed, static_cast<std::uint32_t>(view), static_cast<std::uint32_t>(trial)};
    random_.seed(sequence);
  }
  std::uint32_t Bits() { return static_cast<std::uint32_t>(random_()); }
  double Uniform(double lower, double upper) { return lower + (upper - lower) * (Bits() / 4294967296.0); }
  int Index(int count) { return static_cast<int>(static_cast<std::uint64_t>(Bits()) * static_cast<std::uint64_t>(count) >> 32); }
  // The lower of two draws: all levels come up, but most images of a working camera are good ones.
  double Level(double max) {
    const int first = Index(kLevels), second = Index(kLevels);
    return max * std::min(first, second) / (kLevels - 1);
  }

 private:
  std::mt19937 random_;
};

// A random window of a random background; enlarged where it is too small, grey noise where there is none.
cv::Mat Background(const std::vector<cv::Mat>& backgrounds, const cv::Size& size, Dice* dice) {
  if (backgrounds.empty()) {
    cv::RNG random(dice->Bits());
    cv::Mat coarse(size.height / 4 + 1, size.width / 4 + 1, CV_8UC1), grey, image;
    random.fill(coarse, cv::RNG::NORMAL, 128.0, 40.0);
    cv::resize(coarse, grey, size, 0, 0, cv::INTER_CUBIC);
    cv::cvtColor(grey, image, cv::COLOR_GRAY2BGR);
    return image;
  }
  cv::Mat image = backgrounds[static_cast<std::size_t>(dice->Index(static_cast<int>(backgrounds.size())))];
  const double enlarge = std::max(size.width / static_cast<double>(image.cols), size.height / static_cast<double>(image.rows));
  if (enlarge > 1.0) {
    cv::resize(image, image,
               cv::Size(std::max(size.width, cvRound(image.cols * enlarge)), std::max(size.height, cvRound(image.rows * enlarge))));
  }
  const int x = dice->Index(image.cols - size.width + 1), y = dice->Index(image.rows - size.height + 1);
  return image(cv::Rect({x, y}, size));
}

// Runs the trials of one view after another.
class TrialRunner {
 public:
  TrialRunner(const model::ObjectModel& object, const std::vector<cv::Mat>& backgrounds,
              const recognition::RecogniserParams& recogniser, const TrialParams& params)
      : object_(object), surface_(object), points_(object.PointMatrix()), backgrounds_(backgrounds), params_(params) {
    recogniser_params_ = recogniser;
    recogniser_params_.use_query_depth = false;  // A virtual image is known to the recogniser by its colours only.
    recogniser_params_.min_probability = 0.0;    // Unlikely hypotheses are what is to be learned about.
  }

  void SetView(int view) {
    view_ = view;
    recogniser_ = std::make_unique<recognition::Recogniser>(recogniser_params_);
    recogniser_->Set(std::make_shared<model::ObjectModel>(object_.OnlyView(view)));
  }

  // The dice depend on seed, view and trial only: what was run before makes no difference.
  Trial Run(int number, bool object_shown) {
    Dice dice(params_.seed, view_, number);
    Trial trial;
    trial.view = view_;
    trial.object_shown = object_shown;
    VirtualPose pose;
    pose.rotation_rad = dice.Uniform(0.0, params_.max_rotation_deg) * M_PI / 180.0;
    pose.tilt_rad = dice.Uniform(0.0, 2.0 * M_PI);
    pose.roll_rad = dice.Uniform(-M_PI, M_PI);
    pose.log2_scale = dice.Uniform(-params_.max_scale_octaves, params_.max_scale_octaves);
    Disturbance disturbance;
    disturbance.brightness = 1.0 + dice.Uniform(-params_.max_brightness, params_.max_brightness);
    disturbance.gamma = 1.0 + dice.Uniform(-params_.max_brightness, params_.max_brightness);
    disturbance.image_noise = trial.image_noise = dice.Level(params_.max_image_noise);
    disturbance.blur_px = trial.blur_px = dice.Level(params_.max_blur_px);

    const geometry::Rigid T_camera_object = VirtualCameraPose(object_.views[static_cast<std::size_t>(view_)], pose);
    rgbd::Frame frame;
    // A close object may be twice the size.
    frame.camera = surface_.Window(view_, T_camera_object, 2 * params_.image_width, 2 * params_.image_height);
    const cv::Mat background = Background(backgrounds_, cv::Size(frame.camera.width, frame.camera.height), &dice);
    if (object_shown) {
      trial.rotation_rad = pose.rotation_rad;
      trial.log2_scale = pose.log2_scale;
      frame.color = Paste(surface_.Render(frame.camera, T_camera_object), background);
    } else {
      frame.color = background.clone();
    }
    Disturb(disturbance, dice.Bits(), &frame.color);
    Recognise(frame, T_camera_object, &trial);
    return trial;
  }

 private:
  void Recognise(const rgbd::Frame& frame, const geometry::Rigid& T_camera_object, Trial* trial) const {
    const auto detections = recogniser_->Recognise(frame, recogniser_->Extract(frame));
    if (detections.empty()) return;
    trial->hypothesis = true;
    trial->confidence = detections.front().confidence.value;
    trial->correct = trial->object_shown &&
                     model::MeanPointDistance(points_, detections.front().T_camera_object, T_camera_object) < params_.correct_m;
  }

  const model::ObjectModel& object_;
  const VirtualObject surface_;
  const Eigen::Matrix3Xd points_;
  const std::vector<cv::Mat>& backgrounds_;
  const TrialParams& params_;
  recognition::RecogniserParams recogniser_params_;
  std::unique_ptr<recognition::Recogniser> recogniser_;
  int view_ = 0;
};

}  // namespace

void TrialParams::Check() const {
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(std::string("trials: ") + what);
  };
  require(trials_per_view >= 1, "trials_per_view must be >= 1");
  require(negatives_per_view >= 0, "negatives_per_view must be >= 0");
  require(max_rotation_deg > 0.0 && max_rotation_deg <= 90.0, "max_rotation_deg must be in (0, 90]");
  require(max_scale_octaves >= 0.0, "max_scale_octaves must be >= 0");
  require(max_image_noise >= 0.0, "max_image_noise must be >= 0");
  require(max_blur_px >= 0.0, "max_blur_px must be >= 0");
  require(max_brightness >= 0.0 && max_brightness < 1.0, "max_brightness must be in [0, 1)");
  require(correct_m > 0.0, "correct_m must be > 0");
  require(image_width >= 64, "image_width must be >= 64");
  require(image_height >= 64, "image_height must be >= 64");
}

std::vector<Trial> RunTrials(const model::ObjectModel& object, int first_view, const std::vector<cv::Mat>& backgrounds,
                             const recognition::RecogniserParams& recogniser, const TrialParams& params,
                             const std::function<void(int done, int of)>& progress) {
  params.Check();
  for (const cv::Mat& background : backgrounds) {
    if (background.empty() || background.type() != CV_8UC3) throw std::invalid_argument("RunTrials: backgrounds must be CV_8UC3");
  }
  if (first_view < 0) throw std::invalid_argument("RunTrials: first_view must be >= 0");
  std::vector<Trial> trials;
  const int views = static_cast<int>(object.views.size());
  if (first_view >= views) return trials;
  const int per_view = params.trials_per_view + params.negatives_per_view;
  TrialRunner runner(object, backgrounds, recogniser, params);
  for (int view = first_view; view < views; ++view) {
    const model::View& learned = object.views[static_cast<std::size_t>(view)];
    // A view without depth cannot be shown, one without points cannot be recognised.
    if (learned.points.empty() || learned.keyframe.depth.empty()) continue;
    runner.SetView(view);
    for (int i = 0; i < per_view; ++i) {
      trials.push_back(runner.Run(i, i < params.trials_per_view));
      if (progress) progress(static_cast<int>(trials.size()), (views - first_view) * per_view);
    }
  }
  return trials;
}

}  // namespace vantage::assessment
