#include "learning/params.h"

#include <stdexcept>
#include <string>

namespace vantage::learning {

void LearnerParams::Check() const {
  plane.Check();
  clusters.Check();
  recogniser.Check();
  refinement.Check();
  loop_closure.Check();
  upkeep.Check();
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(std::string("learner: ") + what);
  };
  require(new_view_confidence > 0.0 && new_view_confidence < 1.0, "new_view_confidence must be in (0, 1)");
  require(min_track_probability > 0.0 && min_track_probability < 1.0, "min_track_probability must be in (0, 1)");
  require(min_view_points >= 4, "min_view_points must be >= 4");
  require(min_view_angle_deg >= 0.0, "min_view_angle_deg must be >= 0");
  require(surface_samples >= 0, "surface_samples must be >= 0");
  require(texture_samples >= 0, "texture_samples must be >= 0");
  require(surface_views >= 1, "surface_views must be >= 1");
  require(max_spread_m > 0.0, "max_spread_m must be > 0");
  require(max_spread_deg > 0.0, "max_spread_deg must be > 0");
  require(min_links >= 3, "min_links must be >= 3");
  require(min_surface_agreement > 0.0 && min_surface_agreement <= 1.0, "min_surface_agreement must be in (0, 1]");
  require(max_plain_spread_deg > 0.0, "max_plain_spread_deg must be > 0");
  require(min_plain_confidence >= 0.0 && min_plain_confidence < 1.0, "min_plain_confidence must be in [0, 1)");
  require(surface_prior >= 0.5 && surface_prior < 1.0, "surface_prior must be in [1/2, 1)");
  require(min_likeness >= -1.0 && min_likeness <= 1.0, "min_likeness must be in [-1, 1]");
  require(neighbour_views >= 0, "neighbour_views must be >= 0");
  require(roi_margin >= 0.0, "roi_margin must be >= 0");
  require(min_roi_margin_px >= 0.0, "min_roi_margin_px must be >= 0");
  require(sure_probability > 0.0 && sure_probability < 1.0, "sure_probability must be in (0, 1)");
  require(confirm_frames >= 0, "confirm_frames must be >= 0");
  require(refine_delay_frames >= 1, "refine_delay_frames must be >= 1");
  require(refined_views >= 1, "refined_views must be >= 1");
  require(moved_frames >= 1, "moved_frames must be >= 1");
  require(max_mount_translation_m > 0.0, "max_mount_translation_m must be > 0");
  require(max_mount_rotation_deg > 0.0, "max_mount_rotation_deg must be > 0");
  require(mount_sigma_m > 0.0, "mount_sigma_m must be > 0");
  require(mount_sigma_deg > 0.0, "mount_sigma_deg must be > 0");
  require(agreement_prior >= 0.5 && agreement_prior < 1.0, "agreement_prior must be in [1/2, 1)");
}

}  // namespace vantage::learning
