#include "vantage/pose_witness.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <sstream>

#include "pose/bundle.h"
#include "pose/ransac.h"
#include "vantage/learner_trial.h"

namespace vantage::cli {
namespace {

using Poses = std::vector<geometry::Rigid>;  // T_camera_world, one per frame.

// Interest points of all frames; those that were found to show the same have the same root.
class Tracks {
 public:
  explicit Tracks(const std::vector<features::Features>& features) {
    for (const features::Features& of_frame : features) {
      first_.push_back(static_cast<int>(parents_.size()));
      parents_.resize(parents_.size() + of_frame.size());
    }
    std::iota(parents_.begin(), parents_.end(), 0);
  }

  void Join(int frame_a, int keypoint_a, int frame_b, int keypoint_b) {
    parents_[Root(first_[frame_a] + keypoint_a)] = Root(first_[frame_b] + keypoint_b);
  }

  struct Sighting {
    int frame = 0;
    int keypoint = 0;
  };
  // Those of two or more frames, none of which sees the point twice.
  std::vector<std::vector<Sighting>> Clean(const std::vector<features::Features>& features) {
    std::map<int, std::vector<Sighting>> by_root;
    for (int frame = 0; frame < static_cast<int>(features.size()); ++frame) {
      for (int k = 0; k < features[frame].size(); ++k) by_root[Root(first_[frame] + k)].push_back({frame, k});
    }
    std::vector<std::vector<Sighting>> clean;
    for (auto& [root, sightings] : by_root) {
      std::set<int> frames;
      for (const Sighting& sighting : sightings) frames.insert(sighting.frame);
      if (sightings.size() >= 2 && frames.size() == sightings.size()) clean.push_back(std::move(sightings));
    }
    return clean;
  }

 private:
  int Root(int i) {
    while (parents_[i] != i) i = parents_[i] = parents_[parents_[i]];
    return i;
  }

  std::vector<int> first_;  // Of each frame.
  std::vector<int> parents_;
};

class Witness {
 public:
  Witness(const std::vector<WitnessedFrame>& frames, const learning::LearnerParams& params) : frames_(frames), params_(params) {
    for (const WitnessedFrame& seen : frames) {
      features_.push_back(features::Extract(rgbd::Gray(seen.frame), cv::Mat(), params.recogniser.features));
    }
    Tracks tracks(features_);
    start_.assign(frames.size(), geometry::Rigid::Identity());
    const int count = static_cast<int>(frames.size());
    for (const int gap : {1, 2, 3, 5, 8, 13, 21, 34}) {
      for (int a = 0; a + gap < count; ++a) {
        const auto motion = JoinMatches(a, a + gap, &tracks);
        if (gap > 1) continue;
        hangs_together_ = hangs_together_ && motion.has_value();
        start_[a + 1] = motion.value_or(geometry::Rigid::Identity()) * start_[a];
      }
    }
    tracks_ = tracks.Clean(features_);
  }

  bool hangs_together() const { return hangs_together_; }

  // By every `step`-th track from `first`.
  Poses Adjust(std::size_t first, std::size_t step, Json* figures) const {
    pose::BundleProblem problem;
    for (std::size_t i = 0; i < frames_.size(); ++i) problem.views.push_back({start_[i], frames_[i].frame.camera, i == 0, {}});
    for (std::size_t t = first; t < tracks_.size(); t += step) AddTrack(tracks_[t], &problem);
    pose::BundleParams params = params_.refinement.bundle;
    params.max_iterations = 200;
    params.tolerance = 1e-7;
    const pose::BundleReport report = pose::AdjustBundle(&problem, params);
    *figures = {{"points", report.points}, {"rms_px", report.final_rms_px}};
    Poses poses;
    for (const pose::BundleView& view : problem.views) poses.push_back(view.T_camera_object);
    return poses;
  }

 private:
  Eigen::Vector2d Pixel(int frame, int keypoint) const {
    const cv::Point2f& at = features_[frame].keypoints[keypoint].pt;
    return {at.x, at.y};
  }

  // The camera's motion from a to b where enough points agree about it, which then are the same.
  std::optional<geometry::Rigid> JoinMatches(int a, int b, Tracks* tracks) const {
    constexpr std::size_t kFew = 25;
    const recognition::RecogniserParams& recogniser = params_.recogniser;
    std::vector<pose::Match2d3d> matches;
    std::vector<features::Match> pairs;
    for (const features::Match& match :
         features::MatchRatio(features_[b].descriptors, features_[a].descriptors, recogniser.matching.max_ratio)) {
      const auto point = rgbd::PointAt(frames_[a].frame, Pixel(a, match.train));
      if (!point) continue;
      matches.push_back({Pixel(b, match.query), *point});
      pairs.push_back(match);
    }
    const auto estimate = pose::EstimatePose(matches, frames_[b].frame.camera, nullptr, recogniser.ransac, recogniser.seed);
    if (!estimate || estimate->inliers.size() < kFew) return std::nullopt;
    for (const int i : estimate->inliers) tracks->Join(a, pairs[i].train, b, pairs[i].query);
    return estimate->T_camera_object;
  }

  void AddTrack(const std::vector<Tracks::Sighting>& track, pose::BundleProblem* problem) const {
    const Tracks::Sighting& first = track.front();
    const auto point = rgbd::PointAt(frames_[first.frame].frame, Pixel(first.frame, first.keypoint));
    if (!point) return;
    const int index = static_cast<int>(problem->points.size());
    problem->points.push_back(start_[first.frame].inverse() * *point);
    for (const Tracks::Sighting& sighting : track) {
      const Eigen::Vector2d pixel = Pixel(sighting.frame, sighting.keypoint);
      const double depth_m = rgbd::DepthAt(frames_[sighting.frame].frame, pixel).value_or(0.0);
      problem->observations.push_back({sighting.frame, index, pixel, depth_m});
    }
  }

  const std::vector<WitnessedFrame>& frames_;
  const learning::LearnerParams& params_;
  std::vector<features::Features> features_;
  std::vector<std::vector<Tracks::Sighting>> tracks_;
  Poses start_;
  bool hangs_together_ = true;
};

// Each frame's pose as seen from the first frame's.
Json Difference(const Poses& a, const Poses& b) {
  std::vector<PoseError> errors;
  for (std::size_t i = 1; i < a.size(); ++i) {
    const geometry::PoseDifference difference = geometry::Difference(a[i] * a[0].inverse(), b[i] * b[0].inverse());
    errors.push_back({1e3 * difference.translation_m, difference.rotation_rad * 180.0 / M_PI});
  }
  return ErrorFigures(errors);
}

}  // namespace

Json WitnessFigures(const std::vector<WitnessedFrame>& frames, const learning::LearnerParams& params) {
  if (frames.size() < 2) return nullptr;
  const Witness witness(frames, params);
  if (!witness.hangs_together()) return nullptr;
  Json figures, of_half;
  const Poses all = witness.Adjust(0, 1, &figures);
  Poses recorded, tracked;
  for (const WitnessedFrame& seen : frames) {
    recorded.push_back(seen.T_camera_recorded);
    tracked.push_back(seen.T_camera_object);
  }
  figures["own"] = Difference(witness.Adjust(0, 2, &of_half), witness.Adjust(1, 2, &of_half));
  figures["recorded"] = Difference(recorded, all);
  figures["tracked"] = Difference(tracked, all);
  figures["each_other"] = Difference(tracked, recorded);
  return figures;
}

std::string WitnessSummary(const Json& figures) {
  if (figures.is_null()) return "no witness: the pictures share too few points to be held against each other\n";
  std::ostringstream text;
  const auto both = [](const Json& error) {
    std::ostringstream one;
    one << error["mm"]["median"] << " mm " << error["deg"]["median"] << " deg (p95 " << error["deg"]["p95"] << ")";
    return one.str();
  };
  text << "whole images adjusted (" << figures["points"] << " points, " << figures["rms_px"]
       << " px), in the median: by one half of the points against by the other " << both(figures["own"])
       << "; recorded poses against it " << both(figures["recorded"]) << ", tracked " << both(figures["tracked"]) << "; these two "
       << both(figures["each_other"]) << '\n';
  return text.str();
}

}  // namespace vantage::cli
