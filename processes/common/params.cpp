#include "common/params.h"

#include <sstream>

#include "common/calibration_file.h"

namespace vantage::params {
namespace {

// The fields of every struct, once: visitor(name, value) for values, visitor.Nested(name, struct) for structs.

template <typename Visitor>
void Fields(Visitor& visit, features::FeatureParams& params) {
  visit("type", params.type);
  visit("max_keypoints", params.max_keypoints);
  visit("contrast_threshold", params.contrast_threshold);
}

template <typename Visitor>
void Fields(Visitor& visit, model::ConfidenceParams& params) {
  visit("support_px", params.support_px);
  visit("max_scale_ratio", params.max_scale_ratio);
  visit("max_incidence_deg", params.max_incidence_deg);
  visit("occlusion_m", params.occlusion_m);
  visit("min_points", params.min_points);
  visit("max_views", params.max_views);
}

template <typename Visitor>
void Fields(Visitor& visit, pose::RansacParams& params) {
  visit("inlier_px", params.inlier_px);
  visit("failure_rate", params.failure_rate);
  visit("min_iterations", params.min_iterations);
  visit("min_joint_iterations", params.min_joint_iterations);
  visit("max_iterations", params.max_iterations);
  visit("max_depth_error_m", params.max_depth_error_m);
  visit("min_depth_support", params.min_depth_support);
}

template <typename Visitor>
void Fields(Visitor& visit, recognition::VerificationParams& params) {
  visit("max_seen_through", params.max_seen_through);
  visit("merge_distance", params.merge_distance);
  visit("min_own_share", params.min_own_share);
  visit("max_instances", params.max_instances);
}

template <typename Visitor>
void Fields(Visitor& visit, recognition::MatchingParams& params) {
  visit("max_ratio", params.max_ratio);
  visit("exhaustive_points", params.exhaustive_points);
  visit("max_candidates", params.max_candidates);
  visit("paths", params.paths);
  visit("neighbours", params.neighbours);
  visit("max_chance_ratio", params.max_chance_ratio);
  visit("ranking", params.ranking);
  visit("norm", params.norm);
  visit("background_documents", params.background_documents);
  visit("vocabulary", params.vocabulary);
  visit("branching", params.branching);
  visit("max_leaf_points", params.max_leaf_points);
}

template <typename Visitor>
void Fields(Visitor& visit, recognition::RecogniserParams& params) {
  visit.Nested("features", params.features);
  visit.Nested("confidence", params.confidence);
  visit.Nested("matching", params.matching);
  visit("vote_bandwidth", params.vote_bandwidth);
  visit("max_clusters", params.max_clusters);
  visit.Nested("ransac", params.ransac);
  visit("min_inliers", params.min_inliers);
  visit("guided_radius_px", params.guided_radius_px);
  visit("guided_max_distance", params.guided_max_distance);
  visit.Nested("verification", params.verification);
  visit("use_query_depth", params.use_query_depth);
  visit("min_probability", params.min_probability);
  visit("seed", params.seed);
}

template <typename Visitor>
void Fields(Visitor& visit, segmentation::PlaneParams& params) {
  visit("max_distance_m", params.max_distance_m);
  visit("confidence", params.confidence);
  visit("max_iterations", params.max_iterations);
  visit("step_px", params.step_px);
  visit("min_share", params.min_share);
  visit("min_size_m", params.min_size_m);
  visit("max_depth_m", params.max_depth_m);
  visit("min_up", params.min_up);
}

template <typename Visitor>
void Fields(Visitor& visit, segmentation::ClusterParams& params) {
  visit("min_height_m", params.min_height_m);
  visit("max_height_m", params.max_height_m);
  visit("max_jump_m", params.max_jump_m);
  visit("bridge_px", params.bridge_px);
  visit("merge_share", params.merge_share);
  visit("crease_arm_m", params.crease_arm_m);
  visit("min_crease_deg", params.min_crease_deg);
  visit("min_part_m", params.min_part_m);
  visit("min_crease_share", params.min_crease_share);
  visit("min_size_m", params.min_size_m);
  visit("max_size_m", params.max_size_m);
  visit("min_pixels", params.min_pixels);
}

template <typename Visitor>
void Fields(Visitor& visit, pose::DepthNoise& params) {
  visit("base_m", params.base_m);
  visit("slope", params.slope);
}

template <typename Visitor>
void Fields(Visitor& visit, pose::BundleParams& params) {
  visit("pixel_sigma", params.pixel_sigma);
  visit.Nested("depth_noise", params.depth_noise);
  visit("robust_sigmas", params.robust_sigmas);
  visit("max_iterations", params.max_iterations);
  visit("max_anneal", params.max_anneal);
  visit("tolerance", params.tolerance);
}

template <typename Visitor>
void Fields(Visitor& visit, pose::DenseParams& params) {
  visit("independent_matches", params.independent_matches);
  visit("min_texture_sigma", params.min_texture_sigma);
}

template <typename Visitor>
void Fields(Visitor& visit, learning::RefinementParams& params) {
  visit.Nested("bundle", params.bundle);
  visit.Nested("dense", params.dense);
  visit("surface_samples", params.surface_samples);
  visit("texture_samples", params.texture_samples);
  visit("related_views", params.related_views);
  visit("min_shared_points", params.min_shared_points);
  visit("min_likeness", params.min_likeness);
  visit("max_relation_move_m", params.max_relation_move_m);
  visit("use_depth", params.use_depth);
  visit("max_link_error_sigmas", params.max_link_error_sigmas);
}

template <typename Visitor>
void Fields(Visitor& visit, learning::LoopClosureParams& params) {
  visit("max_view_angle_deg", params.max_view_angle_deg);
  visit("max_octaves", params.max_octaves);
  visit("max_shared", params.max_shared);
  visit("min_views_between", params.min_views_between);
  visit("max_candidates", params.max_candidates);
  visit("max_ratio", params.max_ratio);
  visit.Nested("ransac", params.ransac);
  visit("min_inliers", params.min_inliers);
  visit("min_inlier_share", params.min_inlier_share);
  visit("min_spread", params.min_spread);
  visit("max_drift_m", params.max_drift_m);
  visit("max_drift_deg", params.max_drift_deg);
  visit("surface_samples", params.surface_samples);
  visit("surface_tolerance_m", params.surface_tolerance_m);
  visit("min_surface_overlap", params.min_surface_overlap);
  visit("max_surface_conflict", params.max_surface_conflict);
  visit("min_linked_inliers", params.min_linked_inliers);
  visit("seed", params.seed);
}

template <typename Visitor>
void Fields(Visitor& visit, learning::UpkeepParams& params) {
  visit("max_descriptors", params.max_descriptors);
  visit("min_visible", params.min_visible);
  visit("min_seen_share", params.min_seen_share);
  visit("redundant_angle_deg", params.redundant_angle_deg);
  visit("redundant_octaves", params.redundant_octaves);
  visit("max_views", params.max_views);
  visit("min_view_points", params.min_view_points);
}

template <typename Visitor>
void Fields(Visitor& visit, learning::LearnerParams& params) {
  visit.Nested("plane", params.plane);
  visit.Nested("clusters", params.clusters);
  visit("new_view_confidence", params.new_view_confidence);
  visit("min_track_probability", params.min_track_probability);
  visit("min_view_points", params.min_view_points);
  visit("min_view_angle_deg", params.min_view_angle_deg);
  visit("max_spread_m", params.max_spread_m);
  visit("max_spread_deg", params.max_spread_deg);
  visit("min_links", params.min_links);
  visit("min_likeness", params.min_likeness);
  visit("neighbour_views", params.neighbour_views);
  visit("roi_margin", params.roi_margin);
  visit("min_roi_margin_px", params.min_roi_margin_px);
  visit("surface_samples", params.surface_samples);
  visit("texture_samples", params.texture_samples);
  visit("surface_views", params.surface_views);
  visit("agreement_prior", params.agreement_prior);
  visit("min_surface_agreement", params.min_surface_agreement);
  visit("surface_prior", params.surface_prior);
  visit("max_plain_spread_deg", params.max_plain_spread_deg);
  visit("min_plain_confidence", params.min_plain_confidence);
  visit("refine", params.refine);
  visit("refine_delay_frames", params.refine_delay_frames);
  visit("refined_views", params.refined_views);
  visit.Nested("refinement", params.refinement);
  visit.Nested("loop_closure", params.loop_closure);
  visit.Nested("upkeep", params.upkeep);
  visit("sure_probability", params.sure_probability);
  visit("confirm_frames", params.confirm_frames);
  visit("moved_frames", params.moved_frames);
  visit("require_mount_agreement", params.require_mount_agreement);
  visit("max_mount_translation_m", params.max_mount_translation_m);
  visit("max_mount_rotation_deg", params.max_mount_rotation_deg);
  visit("mount_sigma_m", params.mount_sigma_m);
  visit("mount_sigma_deg", params.mount_sigma_deg);
}

template <typename Visitor>
void Fields(Visitor& visit, assessment::TrialParams& params) {
  visit("trials_per_view", params.trials_per_view);
  visit("negatives_per_view", params.negatives_per_view);
  visit("max_rotation_deg", params.max_rotation_deg);
  visit("min_elevation_deg", params.min_elevation_deg);
  visit("max_scale_octaves", params.max_scale_octaves);
  visit("max_image_noise", params.max_image_noise);
  visit("max_blur_px", params.max_blur_px);
  visit("level_ratio", params.level_ratio);
  visit("max_brightness", params.max_brightness);
  visit("lamp_share", params.lamp_share);
  visit("max_occlusion", params.max_occlusion);
  visit("correct_m", params.correct_m);
  visit("image_width", params.image_width);
  visit("image_height", params.image_height);
  visit("observed_fit", params.observed_fit);
  visit("seed", params.seed);
}

template <typename Visitor>
void Fields(Visitor& visit, exploration::PlannerParams& params) {
  visit("worth_s", params.worth_s);
  visit("target_completeness", params.target_completeness);
  visit("min_detect_probability", params.min_detect_probability);
  visit("attempt_log_odds", params.attempt_log_odds);
  visit("min_view_angle_rad", params.min_view_angle_rad);
  visit("t_plan_s", params.t_plan_s);
  visit("t_learn_s", params.t_learn_s);
  visit("time_budget_s", params.time_budget_s);
  visit("max_attempts", params.max_attempts);
  visit("choose_by_rate", params.choose_by_rate);
  visit("failure_radius_rad", params.failure_radius_rad);
  visit("failure_discount", params.failure_discount);
  visit("max_path_goals", params.max_path_goals);
  visit("rule", params.rule);
}

template <typename Visitor>
void Fields(Visitor& visit, exploration::CandidateParams& params) {
  visit("directions", params.directions);
  visit("min_elevation_rad", params.min_elevation_rad);
  visit("max_elevation_rad", params.max_elevation_rad);
  visit("distances_m", params.distances_m);
}

template <typename Visitor>
void Fields(Visitor& visit, motion::SpeedLimits& params) {
  visit("max_speed_m_s", params.max_speed_m_s);
  visit("max_acceleration_m_s2", params.max_acceleration_m_s2);
  visit("max_turn_rate_rad_s", params.max_turn_rate_rad_s);
  visit("max_turn_acceleration_rad_s2", params.max_turn_acceleration_rad_s2);
}

template <typename Visitor>
void Fields(Visitor& visit, motion::FreeMountParams& params) {
  visit("camera_radius_m", params.camera_radius_m);
  visit("clearance_m", params.clearance_m);
  visit("workspace_lower_m", params.workspace_lower_m);
  visit("workspace_upper_m", params.workspace_upper_m);
  visit("roadmap_samples", params.roadmap_samples);
  visit.Nested("limits", params.limits);
}

template <typename Visitor>
void Fields(Visitor& visit, motion::ArmMountParams& params) {
  visit("urdf", params.urdf);
  visit("base_position_m", params.base_position_m);
  visit("base_yaw_rad", params.base_yaw_rad);
  visit("base_roll_rad", params.base_roll_rad);
  visit("camera_position_m", params.camera_position_m);
  visit("camera_rotation_rad", params.camera_rotation_rad);
  visit("clearance_m", params.clearance_m);
  visit("max_acceleration_rad_s2", params.max_acceleration_rad_s2);
  visit("ik_seeds", params.ik_seeds);
  visit("ik_solutions", params.ik_solutions);
  visit("roadmap_samples", params.roadmap_samples);
}

template <typename Visitor>
void Fields(Visitor& visit, motion::MountParams& params) {
  visit("type", params.type);
  visit.Nested("free", params.free);
  visit.Nested("arm", params.arm);
}

template <typename Visitor>
void Sections(Visitor& visit, LibraryParams& params) {
  visit.Nested("recogniser", params.recogniser);
  visit.Nested("learner", params.learner);
  visit.Nested("trials", params.trials);
  visit.Nested("planner", params.planner);
  visit.Nested("candidates", params.candidates);
  visit.Nested("mount", params.mount);
  visit("hand_eye", params.hand_eye);
}

class YamlReader {
 public:
  explicit YamlReader(config::Mapping& mapping) : mapping_(mapping) {}

  template <typename Value>
  void operator()(const std::string& key, Value& value) {
    mapping_.Get(key, value);
  }

  void operator()(const std::string& key, measures::CompletenessRule& rule) {
    Named(key, measures::CompletenessRuleFromString, rule);
  }
  void operator()(const std::string& key, measures::ObservedFit& fit) { Named(key, measures::ObservedFitFromString, fit); }

  template <typename Params>
  void Nested(const std::string& key, Params& params) {
    config::Mapping child = mapping_.Child(key);
    YamlReader reader(child);
    Fields(reader, params);
    child.Finish();
    child.Check(params);
  }

 private:
  // A value that is written as one of a few names; `from_text` throws std::invalid_argument for others.
  template <typename Value>
  void Named(const std::string& key, Value (*from_text)(const std::string&), Value& value) {
    std::string text = measures::ToString(value);
    mapping_.Get(key, text);
    try {
      value = from_text(text);
    } catch (const std::invalid_argument& error) {
      mapping_.Fail(key, error.what());
    }
  }

  config::Mapping& mapping_;
};

class Flattener {
 public:
  Flattener(std::string prefix, std::map<std::string, std::string>& values) : prefix_(std::move(prefix)), values_(values) {}

  template <typename Value>
  void operator()(const std::string& key, const Value& value) {
    std::ostringstream text;
    text.precision(17);
    Print(text, value);
    values_[prefix_ + key] = text.str();
  }

  template <typename Params>
  void Nested(const std::string& key, Params& params) {
    Flattener nested(prefix_ + key + ".", values_);
    Fields(nested, params);
  }

 private:
  template <typename Value>
  static void Print(std::ostream& text, const Value& value) {
    text << value;
  }
  static void Print(std::ostream& text, const measures::CompletenessRule& rule) { text << measures::ToString(rule); }
  static void Print(std::ostream& text, const measures::ObservedFit& fit) { text << measures::ToString(fit); }
  static void Print(std::ostream& text, const Eigen::Vector3d& vector) { text << vector.transpose(); }
  static void Print(std::ostream& text, const std::vector<double>& numbers) {
    for (const double number : numbers) text << number << ' ';
  }

  std::string prefix_;
  std::map<std::string, std::string>& values_;
};

template <typename Params>
void ReadWhole(config::Mapping& mapping, Params& params) {
  YamlReader reader(mapping);
  Fields(reader, params);
  mapping.Finish();
  mapping.Check(params);
}

}  // namespace

void Read(config::Mapping mapping, recognition::RecogniserParams& params) { ReadWhole(mapping, params); }
void Read(config::Mapping mapping, learning::LearnerParams& params) { ReadWhole(mapping, params); }
void Read(config::Mapping mapping, assessment::TrialParams& params) { ReadWhole(mapping, params); }
void Read(config::Mapping mapping, exploration::PlannerParams& params) { ReadWhole(mapping, params); }
void Read(config::Mapping mapping, exploration::CandidateParams& params) { ReadWhole(mapping, params); }
void Read(config::Mapping mapping, motion::MountParams& params) { ReadWhole(mapping, params); }

void ReadSections(config::Mapping& mapping, LibraryParams& params) {
  YamlReader reader(mapping);
  Sections(reader, params);
  params.learner.recogniser = params.recogniser;
}

LibraryParams LoadLibraryParams(const std::filesystem::path& file) {
  config::Mapping mapping = config::Mapping::Load(file);
  LibraryParams params;
  ReadSections(mapping, params);
  mapping.Finish();
  for (std::string* beside : {&params.mount.arm.urdf, &params.hand_eye}) {
    if (!beside->empty() && std::filesystem::path(*beside).is_relative()) *beside = (file.parent_path() / *beside).string();
  }
  if (!params.hand_eye.empty()) {
    const auto seat = processes::LoadHandEye(params.hand_eye);
    params.mount.arm.camera_position_m = seat.T_mount_camera.translation();
    params.mount.arm.camera_rotation_rad = seat.RotationVector_rad();
  }
  return params;
}

std::map<std::string, std::string> Flatten(const LibraryParams& params) {
  LibraryParams copy = params;
  std::map<std::string, std::string> values;
  Flattener flattener("", values);
  Sections(flattener, copy);
  return values;
}

}  // namespace vantage::params
