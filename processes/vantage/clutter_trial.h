// Many objects on one simulated table: learned one by one, then found among each other and held against the truth.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "recognition/recogniser.h"
#include "simulation/simulated_world.h"

namespace vantage::cli {

struct ClutterParams {
  int learning_azimuths = 12;  // Views of every object at known poses: so many around it...
  std::vector<double> learning_elevations_deg = {15.0, 38.0, 62.0};
  double learning_distance_m = 0.6;
  int arrangements = 6;             // The world's own, then its objects at each other's places.
  int looks = 5;                    // Cameras in every arrangement; the first is the world's start pose.
  double max_shift_m = 0.02;        // From the places of the world file.
  double max_turn_deg = 40.0;       // From the yaw of the world file.
  double min_share_in_image = 0.9;  // Of an object's points; others are not judged.
  double right_m = 0.04;            // Mean point distance of a right detection.
  double detected = 0.5;            // p(o|c) from which a detection counts.
  std::uint32_t seed = 0;
};

// One object in one frame.
struct Sighting {
  std::string object;
  double occlusion = 0.0;  // Share of its pixels that other objects hide; [0, 1].
  int right = 0;           // Detections that count: 1 or 0 right...
  int wrong = 0;           // ...and wrong ones, also of an object that is not judged in this frame (then judged = false).
  bool judged = true;
};

struct ClutterFrame {
  int arrangement = 0;
  int look = 0;
  double ms = 0.0;  // Interest points and recognition.
  std::vector<Sighting> sightings;
  int right() const;
};

class ClutterTrial {
 public:
  ClutterTrial(const simulation::WorldParams& world, const recognition::RecogniserParams& recogniser, const ClutterParams& params);

  // Learns the objects the store lacks into it (empty name: nowhere), knows them all from now on. Throws std::runtime_error where
  // an object shows too few interest points to be learned. About 10 s an object.
  void Learn(const std::filesystem::path& store);

  // One frame, judged; its picture with the detections, if asked for.
  ClutterFrame Look(int arrangement, int look, cv::Mat* overlay = nullptr);

  int objects() const { return static_cast<int>(places_.size()); }

 private:
  model::ObjectModel LearnObject(int object);
  void Arrange(int arrangement);
  geometry::Rigid CameraPose(int arrangement, int look) const;
  double Occlusion(int object, const cv::Mat& labels, const geometry::Rigid& T_world_camera);

  simulation::WorldParams world_params_;
  ClutterParams params_;
  simulation::SimulatedWorld world_;
  recognition::Recogniser recogniser_;
  std::vector<geometry::Rigid> places_;  // T_world_object as in the world file.
  std::vector<std::shared_ptr<const model::ObjectModel>> models_;
  int arrangement_ = 0;
};

}  // namespace vantage::cli
