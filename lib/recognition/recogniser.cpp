#include "recognition/recogniser.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <opencv2/core/utility.hpp>
#include <stdexcept>
#include <utility>

#include "measures/pooled.h"
#include "pose/multi_ransac.h"
#include "recognition/guided.h"
#include "recognition/voting.h"

namespace vantage::recognition {
namespace {

// Seconds since the last call.
class Stopwatch {
 public:
  double Lap() {
    const auto now = std::chrono::steady_clock::now();
    return std::chrono::duration<double>(now - std::exchange(last_, now)).count();
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

}  // namespace

void RecogniserParams::Check() const {
  features.Check();
  confidence.Check();
  matching.Check();
  ransac.Check();
  verification.Check();
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(std::string("recogniser: ") + what);
  };
  require(max_clusters >= 1, "max_clusters must be >= 1");
  require(vote_bandwidth > 0.0, "vote_bandwidth must be > 0");
  require(min_inliers >= 4, "min_inliers must be >= 4");
  require(guided_radius_px > 0.0, "guided_radius_px must be > 0");
  require(guided_max_distance > 0.0 && guided_max_distance <= 2.0, "guided_max_distance must be in (0, 2]");
  require(min_probability >= 0.0 && min_probability <= 1.0, "min_probability must be in [0, 1]");
}

std::string RecogniserParams::Fingerprint() const {
  return features.Fingerprint() + "|" + confidence.Fingerprint() + "|" + std::to_string(matching.max_ratio) + ":" +
         std::to_string(min_inliers) + ":" + std::to_string(ransac.inlier_px);
}

std::string MeasuresMismatch(const model::ObjectModel& object, const RecogniserParams& params) {
  const std::string& fingerprint = object.measures.fingerprint;
  if (fingerprint.empty() || fingerprint == params.Fingerprint()) return "";
  return "the measures of '" + object.name + "' were learned with other settings (" + fingerprint + ", here " +
         params.Fingerprint() + ") and are not used; learn them again with vantage assess";
}

struct Recogniser::Impl {
  explicit Impl(const RecogniserParams& all) : params(all), matcher(all.matching, all.features.type) {}

  RecogniserParams params;
  Matcher matcher;
  std::map<std::string, measures::ObservedSuccess> own_measures;  // By object, where they hold for these parameters.
  measures::ObservedSuccess pooled;                               // Of the others.

  // Null where the object has none.
  void SetOwn(const std::string& name, const measures::ObservedSuccess* measure) {
    if (measure == nullptr && own_measures.erase(name) == 0) return;
    if (measure != nullptr) own_measures[name] = *measure;
    std::vector<measures::ObservedSuccess> all;
    for (const auto& [object, own] : own_measures) all.push_back(own);
    pooled = measures::PooledObserved(all);
  }

  std::vector<VoteCluster> Vote(const Known& known, const features::Features& features,
                                const std::vector<Tentative>& matches) const {
    std::vector<recognition::Vote> votes;
    for (const Tentative& match : matches) {
      const Entry& entry = known.entries[match.row];
      const cv::KeyPoint& keypoint = known.object->views[entry.view].features.keypoints[entry.keypoint];
      const Eigen::Vector2d to_centre = known.centre_pixel[entry.view] - Eigen::Vector2d(keypoint.pt.x, keypoint.pt.y);
      votes.push_back(CastVote(features.keypoints[match.keypoint], keypoint, to_centre, known.radius_px[entry.view]));
    }
    std::vector<VoteCluster> clusters = MeanShift(votes, params.vote_bandwidth);
    if (static_cast<int>(clusters.size()) > params.max_clusters) clusters.resize(params.max_clusters);
    return clusters;
  }

  // One cluster of tentative matches for each place where an object may be.
  void AddClusters(const ObjectMatches& candidate, const features::Features& features, std::vector<pose::MatchCluster>* clusters,
                   std::vector<const Known*>* owners) const {
    const Known& known = *candidate.known;
    const std::vector<Tentative>& matches = candidate.matches;
    for (const VoteCluster& votes : Vote(known, features, matches)) {
      pose::MatchCluster cluster;
      cluster.min_inliers = params.min_inliers;
      for (const int vote : votes.votes) {
        const Tentative& match = matches[vote];
        const cv::Point2f& pixel = features.keypoints[match.keypoint].pt;
        cluster.matches.push_back({{pixel.x, pixel.y}, known.object->points[known.entries[match.row].point].position});
        cluster.keypoints.push_back(match.keypoint);
      }
      clusters->push_back(std::move(cluster));
      owners->push_back(&known);
    }
  }

  // The pose refined on all that speaks for it; nullopt where that is too little or the depth image contradicts.
  std::optional<Hypothesis> Verify(const Known& known, const rgbd::Frame& frame, const features::Features& features,
                                   const model::KeypointGrid& grid, const geometry::Rigid& T_camera_object) const {
    const GuidedParams guided_params{params.guided_radius_px, params.guided_max_distance, params.ransac.inlier_px, 4};
    const GuidedPose guided = MatchGuided(*known.object, T_camera_object, frame, features, grid, guided_params);
    if (static_cast<int>(guided.matches.size()) < params.min_inliers) return std::nullopt;
    Hypothesis hypothesis{known.object.get(), guided.T_camera_object, {}, {}, {}};
    int measured = 0, supported = 0;
    for (const GuidedMatch& match : guided.matches) {
      const cv::Point2f& pixel = features.keypoints[match.keypoint].pt;
      hypothesis.keypoints.push_back(match.keypoint);
      hypothesis.pixels.emplace_back(pixel.x, pixel.y);
      const double z = (guided.T_camera_object * known.object->points[match.point].position).z();
      hypothesis.depths_m.push_back(z);
      if (const auto depth = rgbd::DepthAt(frame, hypothesis.pixels.back())) {
        ++measured;
        supported += std::abs(z - *depth) < params.ransac.max_depth_error_m;
      }
    }
    if (supported < params.ransac.min_depth_support * measured) return std::nullopt;
    const DepthEvidence evidence = CompareDepth(*known.object, guided.T_camera_object, frame, params.ransac.max_depth_error_m);
    if (IsContradicted(evidence, params.verification)) return std::nullopt;
    return hypothesis;
  }

  // What may be in the frame, all objects together.
  std::vector<Hypothesis> Find(const rgbd::Frame& frame, const features::Features& features, const model::KeypointGrid& grid,
                               Stopwatch& watch, StageTimes& times) const {
    const std::vector<ObjectMatches> candidates = matcher.Match(features);
    times.match_s = watch.Lap();
    std::vector<pose::MatchCluster> clusters;
    std::vector<const Known*> owners;
    for (const ObjectMatches& candidate : candidates) AddClusters(candidate, features, &clusters, &owners);
    times.vote_s = watch.Lap();
    const pose::MultiPose found =
        pose::EstimatePoses(clusters, frame.camera, params.use_query_depth ? &frame : nullptr, params.ransac, params.seed);
    times.pose_s = watch.Lap();
    std::vector<std::optional<Hypothesis>> verified(clusters.size());
    cv::parallel_for_(cv::Range(0, static_cast<int>(clusters.size())), [&](const cv::Range& range) {
      for (int i = range.start; i < range.end; ++i) {
        if (found.poses[i]) verified[i] = Verify(*owners[i], frame, features, grid, found.poses[i]->T_camera_object);
      }
    });
    std::vector<Hypothesis> hypotheses;
    for (auto& hypothesis : verified) {
      if (hypothesis) hypotheses.push_back(std::move(*hypothesis));
    }
    return hypotheses;
  }

  Detection Judge(Hypothesis hypothesis, const rgbd::Frame& frame, const model::KeypointGrid& grid, double prior) const {
    const model::ObjectModel& object = *hypothesis.object;
    Detection detection;
    detection.object = object.name;
    detection.T_camera_object = hypothesis.T_camera_object;
    detection.confidence = model::ObjectConfidence(object, detection.T_camera_object, frame, grid, params.confidence);
    const auto own = own_measures.find(object.name);
    const measures::ObservedSuccess& observed = own == own_measures.end() ? pooled : own->second;
    detection.probability = observed.Probability(detection.confidence.value, prior);
    detection.source = observed.source();
    detection.inliers = static_cast<int>(hypothesis.keypoints.size());
    detection.inlier_pixels = std::move(hypothesis.pixels);
    return detection;
  }
};

Recogniser::Recogniser(const RecogniserParams& params) : params_(params) {
  params.Check();
  impl_ = std::make_unique<Impl>(params);
}
Recogniser::~Recogniser() = default;
Recogniser::Recogniser(Recogniser&&) noexcept = default;
Recogniser& Recogniser::operator=(Recogniser&&) noexcept = default;

void Recogniser::Set(std::shared_ptr<const model::ObjectModel> object) {
  if (object->feature_fingerprint != params_.features.Fingerprint()) {
    throw std::invalid_argument("object " + object->name + " was learned with features " + object->feature_fingerprint +
                                ", the recogniser uses " + params_.features.Fingerprint() +
                                "; learn it again or change the features");
  }
  impl_->matcher.Set(object);
  const bool own = object->measures.observed.source() == measures::Source::kOwn && MeasuresMismatch(*object, params_).empty();
  impl_->SetOwn(object->name, own ? &object->measures.observed : nullptr);
}

void Recogniser::Remove(const std::string& name) {
  impl_->matcher.Remove(name);
  impl_->SetOwn(name, nullptr);
}

const measures::ObservedSuccess& Recogniser::Pooled() const { return impl_->pooled; }

int Recogniser::size() const { return impl_->matcher.size(); }

features::Features Recogniser::Extract(const rgbd::Frame& frame) const {
  return features::Extract(rgbd::Gray(frame), cv::Mat(), params_.features);
}

std::vector<Detection> Recogniser::Recognise(const rgbd::Frame& frame, const features::Features& features,
                                             const std::vector<std::pair<std::string, double>>& priors, StageTimes* times) const {
  Stopwatch watch;
  StageTimes spent;
  rgbd::Frame query = frame;
  if (!params_.use_query_depth) query.depth = cv::Mat();
  const model::KeypointGrid grid(features.keypoints, frame.camera.width, frame.camera.height);
  std::vector<Hypothesis> hypotheses = impl_->Find(query, features, grid, watch, spent);
  std::vector<Detection> detections;
  for (const int i : ResolveConflicts(hypotheses, frame.camera, params_.min_inliers, params_.verification)) {
    double prior = 0.5;
    for (const auto& [object, value] : priors) {
      if (object == hypotheses[i].object->name) prior = value;
    }
    Detection detection = impl_->Judge(std::move(hypotheses[i]), query, grid, prior);
    if (detection.probability >= params_.min_probability) detections.push_back(std::move(detection));
  }
  std::stable_sort(detections.begin(), detections.end(),
                   [](const auto& a, const auto& b) { return a.probability > b.probability; });
  spent.verify_s = watch.Lap();
  if (times != nullptr) *times = spent;
  return detections;
}

}  // namespace vantage::recognition
