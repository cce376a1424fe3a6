#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <stdexcept>
#include <string>

#include "assessment/assessor.h"
#include "assessment/dice.h"
#include "assessment/strength_limit.h"
#include "assessment/virtual_object.h"

namespace vantage::assessment {
namespace {

constexpr int kLevels = 8;     // Of noise and of blur (section VI).
constexpr int kMaxTilts = 50;  // Draws of a direction; then it is taken wherever it is.

// Of the camera above the object's horizon, radians.
double Elevation(const geometry::Rigid& T_camera_object) {
  return std::asin(std::clamp(geometry::ViewDirection(T_camera_object).z(), -1.0, 1.0));
}

cv::Mat GreyNoise(const cv::Size& size, Dice* dice) {
  cv::RNG random(dice->Bits());
  cv::Mat coarse(size.height / 4 + 1, size.width / 4 + 1, CV_8UC1), grey, image;
  random.fill(coarse, cv::RNG::NORMAL, 128.0, 40.0);
  cv::resize(coarse, grey, size, 0, 0, cv::INTER_CUBIC);
  cv::cvtColor(grey, image, cv::COLOR_GRAY2BGR);
  return image;
}

// A random window of the background, enlarged where it is too small.
cv::Mat RandomWindow(cv::Mat image, const cv::Size& size, Dice* dice) {
  const double enlarge = std::max(size.width / static_cast<double>(image.cols), size.height / static_cast<double>(image.rows));
  if (enlarge > 1.0) {
    cv::resize(image, image,
               cv::Size(std::max(size.width, cvRound(image.cols * enlarge)), std::max(size.height, cvRound(image.rows * enlarge))));
  }
  const int x = dice->Index(image.cols - size.width + 1), y = dice->Index(image.rows - size.height + 1);
  return image(cv::Rect({x, y}, size));
}

// Of `max`, in even levels, each `ratio` times as often as the one below: all come up, but most images of a working camera are good
// ones, and its own noise is in the keyframes already.
double Level(double max, double ratio, Dice* dice) {
  double mass = 0.0, weight = 1.0;
  for (int level = 0; level < kLevels; ++level, weight *= ratio) mass += weight;
  double left = dice->Uniform(0.0, mass);
  weight = 1.0;
  int level = 0;
  for (; level < kLevels - 1 && left >= weight; ++level, weight *= ratio) left -= weight;
  return max * level / (kLevels - 1);
}

// Where the object is farther than it was learned, each pixel is the mean of four: the texture's filter alone is softer than a
// lens.
VirtualImage RenderSharply(const VirtualObject& object, const geometry::PinholeCamera& camera,
                           const geometry::Rigid& T_camera_object, bool far) {
  if (!far) return object.Render(camera, T_camera_object);
  VirtualImage image = object.Render(camera.Scaled(2.0), T_camera_object);
  const cv::Size size(camera.width, camera.height);
  cv::resize(image.color, image.color, size, 0, 0, cv::INTER_AREA);
  cv::resize(image.mask, image.mask, size, 0, 0, cv::INTER_AREA);
  cv::resize(image.normals, image.normals, size, 0, 0, cv::INTER_AREA);
  image.mask = image.mask == 255;
  image.color.setTo(cv::Scalar::all(0), image.mask == 0);
  return image;
}

// The light on an object that is carried about and turned: a lamp somewhere above it comes from another side.
void TurnUnderLamp(double lamp_share, Dice* dice, VirtualImage* image) {
  const double z = dice->Uniform(0.0, 1.0);
  const auto lamp = [&](double azimuth) {
    const double across = std::sqrt(1.0 - z * z);
    return Light{1.0 - lamp_share, {across * std::cos(azimuth), across * std::sin(azimuth), z}};
  };
  const Light before = lamp(dice->Uniform(-M_PI, M_PI));
  Relight(before, lamp(dice->Uniform(-M_PI, M_PI)), image);
}

// Puts the background back over a share of the box, from one of its sides: something stands before it.
void Hide(double share, cv::Rect box, const cv::Mat& background, Dice* dice, cv::Mat* image) {
  const int side = dice->Index(4);
  const int width = static_cast<int>(std::lround(share * box.width)), height = static_cast<int>(std::lround(share * box.height));
  if (side == 1) box.x += box.width - width;
  if (side == 3) box.y += box.height - height;
  (side < 2 ? box.width : box.height) = side < 2 ? width : height;
  background(box).copyTo((*image)(box));
}

// Runs the trials of one view after another.
class TrialRunner {
 public:
  TrialRunner(const model::ObjectModel& object, std::vector<Background>* backgrounds,
              const recognition::RecogniserParams& recogniser, const TrialParams& params)
      : object_(object), surface_(object), points_(object.PointMatrix()), backgrounds_(*backgrounds), params_(params) {
    recogniser_params_ = recogniser;
    recogniser_params_.use_query_depth = false;  // A virtual image is known to the recogniser by its colours only.
    recogniser_params_.min_probability = 0.0;    // Unlikely hypotheses are what is to be learned about.
  }

  void SetView(int view) {
    view_ = view;
    std::vector<int> so_far(static_cast<std::size_t>(view) + 1);
    std::iota(so_far.begin(), so_far.end(), 0);
    viewpoints_ = object_.viewpoints();
    viewpoints_.resize(so_far.size());
    median_distance_m_ = MedianDistance(viewpoints_);
    alone_ = RecogniserOf(object_.OnlyView(view));
    together_ = RecogniserOf(object_.OnlyViews(so_far));
  }

  // The dice depend on seed, view and trial only: what was run before makes no difference.
  Trial Run(int number) {
    Dice dice({params_.seed, static_cast<std::uint32_t>(view_), static_cast<std::uint32_t>(number)});
    Trial trial;
    trial.view = view_;
    VirtualPose pose;
    pose.rotation_rad = trial.rotation_rad = dice.Uniform(0.0, params_.max_rotation_deg) * M_PI / 180.0;
    for (int tries = 0; tries < kMaxTilts; ++tries) {
      pose.tilt_rad = dice.Uniform(0.0, 2.0 * M_PI);
      if (Elevation(VirtualCameraPose(View(), pose)) >= params_.min_elevation_deg * M_PI / 180.0) break;
    }
    pose.roll_rad = dice.Uniform(-M_PI, M_PI);
    // The mean of four: objects are mostly met at about the distances they were learned at.
    double nearer = 0.0;
    for (int i = 0; i < 4; ++i) nearer += 0.25 * dice.Uniform(-params_.max_scale_octaves, params_.max_scale_octaves);
    pose.log2_scale = trial.log2_scale = std::log2(View().viewpoint().distance_m / median_distance_m_) + nearer;
    const Disturbance disturbance = RandomDisturbance(&dice, &trial);

    const geometry::Rigid T_camera_object = VirtualCameraPose(View(), pose);
    rgbd::Frame frame;
    // A close object may be twice the size.
    frame.camera = surface_.Window(view_, T_camera_object, 2 * params_.image_width, 2 * params_.image_height);
    const cv::Mat window = Window(frame.camera, &dice);
    VirtualImage shown = RenderSharply(surface_, frame.camera, T_camera_object, pose.log2_scale < 0.0);
    if (params_.lamp_share > 0.0) TurnUnderLamp(params_.lamp_share, &dice, &shown);
    frame.color = Paste(shown, window);
    if (params_.max_occlusion > 0.0) {
      Hide(dice.Uniform(0.0, params_.max_occlusion), cv::boundingRect(shown.mask), window, &dice, &frame.color);
    }
    Disturb(disturbance, dice.Bits(), &frame.color);
    const features::Features features = ExtractStrong(rgbd::Gray(frame), recogniser_params_.features, MinResponse(disturbance));
    trial.alone = Propose(*alone_, frame, features, T_camera_object);
    trial.together = view_ == 0 ? trial.alone : Propose(*together_, frame, features, T_camera_object);
    trial.others = Others(T_camera_object);
    return trial;
  }

  // A whole background where there is one: the next for each number from trials_per_view on, whichever part it is in.
  Trial RunNegative(int number) {
    Dice dice({params_.seed, static_cast<std::uint32_t>(view_), static_cast<std::uint32_t>(number)});
    Trial trial;
    trial.view = view_;
    trial.object_shown = false;
    rgbd::Frame frame;
    frame.camera = View().keyframe.camera;
    frame.camera.width = 2 * params_.image_width;
    frame.camera.height = 2 * params_.image_height;
    features::Features features;
    if (backgrounds_.empty()) {
      frame.color = GreyNoise(cv::Size(frame.camera.width, frame.camera.height), &dice);
      Disturb(RandomDisturbance(&dice, &trial), dice.Bits(), &frame.color);
      features = together_->Extract(frame);
    } else {
      Background& background = backgrounds_[static_cast<std::size_t>(number - params_.trials_per_view)];
      frame.color = background.color;
      frame.camera.width = background.color.cols;
      frame.camera.height = background.color.rows;
      features = FeaturesOf(&background);
    }
    frame.camera.cx = 0.5 * frame.camera.width;
    frame.camera.cy = 0.5 * frame.camera.height;
    trial.together = Propose(*together_, frame, features, std::nullopt);
    return trial;
  }

  // More would be the same again.
  int Negatives() const {
    return backgrounds_.empty() ? params_.negatives_per_view
                                : std::min(params_.negatives_per_view, static_cast<int>(backgrounds_.size()));
  }

 private:
  const model::View& View() const { return object_.views[static_cast<std::size_t>(view_)]; }

  // Of the views before this one.
  std::vector<Displacement> Others(const geometry::Rigid& T_camera_object) const {
    const Eigen::Vector3d direction = geometry::ViewDirection(T_camera_object);
    const double distance_m = T_camera_object.inverse().translation().norm();
    std::vector<Displacement> others;
    for (int i = 0; i < view_; ++i) {
      const measures::Viewpoint& learned = viewpoints_[static_cast<std::size_t>(i)];
      const double rotation_rad = geometry::AngleBetween(learned.direction, direction);
      if (rotation_rad < M_PI_2) others.push_back({rotation_rad, std::log2(learned.distance_m / distance_m)});
    }
    return others;
  }

  std::unique_ptr<recognition::Recogniser> RecogniserOf(model::ObjectModel object) const {
    auto recogniser = std::make_unique<recognition::Recogniser>(recogniser_params_);
    recogniser->Set(std::make_shared<model::ObjectModel>(std::move(object)));
    return recogniser;
  }

  Disturbance RandomDisturbance(Dice* dice, Trial* trial) const {
    Disturbance disturbance;
    disturbance.brightness = 1.0 + dice->Uniform(-params_.max_brightness, params_.max_brightness);
    disturbance.gamma = 1.0 + dice->Uniform(-params_.max_brightness, params_.max_brightness);
    disturbance.image_noise = trial->image_noise = Level(params_.max_image_noise, params_.level_ratio, dice);
    disturbance.blur_px = trial->blur_px = Level(params_.max_blur_px, params_.level_ratio, dice);
    return disturbance;
  }

  const features::Features& FeaturesOf(Background* background) {
    if (!background->features) {
      rgbd::Frame frame;
      frame.color = background->color;
      background->features = std::make_shared<const features::Features>(together_->Extract(frame));
    }
    return *background->features;
  }

  // Of what a whole image, so disturbed, would keep.
  double MinResponse(const Disturbance& disturbance) {
    if (backgrounds_.empty()) return 0.0;
    Background& background = backgrounds_.front();
    if (!background.limit) {
      background.limit = std::make_shared<StrengthLimit>(background.color, FeaturesOf(&background), recogniser_params_.features,
                                                         cv::Size(params_.image_width, params_.image_height));
    }
    return background.limit->Response(disturbance);
  }

  cv::Mat Window(const geometry::PinholeCamera& camera, Dice* dice) const {
    const cv::Size size(camera.width, camera.height);
    if (backgrounds_.empty()) return GreyNoise(size, dice);
    return RandomWindow(backgrounds_[static_cast<std::size_t>(dice->Index(static_cast<int>(backgrounds_.size())))].color, size,
                        dice);
  }

  std::vector<Proposal> Propose(const recognition::Recogniser& recogniser, const rgbd::Frame& frame,
                                const features::Features& features, const std::optional<geometry::Rigid>& T_camera_object) const {
    std::vector<Proposal> proposals;
    for (const recognition::Detection& detection : recogniser.Recognise(frame, features)) {
      const double error_m = T_camera_object ? model::MeanPointDistance(points_, detection.T_camera_object, *T_camera_object)
                                             : std::numeric_limits<double>::infinity();
      proposals.push_back({detection.confidence.value, error_m < params_.correct_m, error_m});
    }
    return proposals;
  }

  const model::ObjectModel& object_;
  const VirtualObject surface_;
  const Eigen::Matrix3Xd points_;
  std::vector<Background>& backgrounds_;
  const TrialParams& params_;
  recognition::RecogniserParams recogniser_params_;
  std::unique_ptr<recognition::Recogniser> alone_;     // The view.
  std::unique_ptr<recognition::Recogniser> together_;  // All views up to this one.
  int view_ = 0;
  std::vector<measures::Viewpoint> viewpoints_;  // Of the views up to this one.
  double median_distance_m_ = 1.0;               // Of these.
};

}  // namespace

void TrialParams::Check() const {
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(std::string("trials: ") + what);
  };
  require(trials_per_view >= 1, "trials_per_view must be >= 1");
  require(negatives_per_view >= 0, "negatives_per_view must be >= 0");
  require(max_rotation_deg > 0.0 && max_rotation_deg <= 90.0, "max_rotation_deg must be in (0, 90]");
  require(min_elevation_deg >= -90.0 && min_elevation_deg < 90.0, "min_elevation_deg must be in [-90, 90)");
  require(max_scale_octaves >= 0.0, "max_scale_octaves must be >= 0");
  require(max_image_noise >= 0.0, "max_image_noise must be >= 0");
  require(max_blur_px >= 0.0, "max_blur_px must be >= 0");
  require(level_ratio > 0.0 && level_ratio <= 1.0, "level_ratio must be in (0, 1]");
  require(lamp_share >= 0.0 && lamp_share < 1.0, "lamp_share must be in [0, 1)");
  require(max_occlusion >= 0.0 && max_occlusion < 1.0, "max_occlusion must be in [0, 1)");
  require(max_brightness >= 0.0 && max_brightness < 1.0, "max_brightness must be in [0, 1)");
  require(correct_m > 0.0, "correct_m must be > 0");
  require(image_width >= 64, "image_width must be >= 64");
  require(image_height >= 64, "image_height must be >= 64");
}

std::vector<Trial> RunTrials(const model::ObjectModel& object, int first_view, std::vector<Background>* backgrounds,
                             const recognition::RecogniserParams& recogniser, const TrialParams& params,
                             const std::function<void(int done, int of)>& progress, const Part& part) {
  params.Check();
  if (part.of < 1 || part.index < 0 || part.index >= part.of)
    throw std::invalid_argument("RunTrials: part.index must be in [0, part.of)");
  for (const Background& background : *backgrounds) {
    if (background.color.empty() || background.color.type() != CV_8UC3)
      throw std::invalid_argument("RunTrials: backgrounds must be CV_8UC3");
  }
  if (first_view < 0) throw std::invalid_argument("RunTrials: first_view must be >= 0");
  std::vector<Trial> trials;
  const int views = static_cast<int>(object.views.size());
  if (first_view >= views) return trials;
  TrialRunner runner(object, backgrounds, recogniser, params);
  const int per_view = params.trials_per_view + runner.Negatives();
  const int in_part = (per_view - part.index + part.of - 1) / part.of;
  for (int view = first_view; view < views; ++view) {
    const model::View& learned = object.views[static_cast<std::size_t>(view)];
    // A view without depth cannot be shown, one without points cannot be recognised.
    if (learned.points.empty() || learned.keyframe.depth.empty()) continue;
    runner.SetView(view);
    for (int i = part.index; i < per_view; i += part.of) {
      trials.push_back(i < params.trials_per_view ? runner.Run(i) : runner.RunNegative(i));
      if (progress) progress(static_cast<int>(trials.size()), (views - first_view) * in_part);
    }
  }
  return trials;
}

}  // namespace vantage::assessment
