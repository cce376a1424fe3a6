#include "pose/bundle.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>

#include "pose/bundle_errors.h"

namespace vantage::pose {
namespace {

constexpr double kInlierScales = 3.0;    // Robust scales within which an observation counts as right.
constexpr double kStageRatio = 4.0;      // From one robust scale to the next.
constexpr int kStageIterations = 4;      // At most, before the last stage.
constexpr int kMinObservations = 3;      // A free view without a prior or relation needs so many.
constexpr double kRelationScales = 3.0;  // A relation has six errors in one: its robust scale is so many of an observation's.

// One adjustment: which observations, views and points take part, their parameter blocks, the Ceres problem and its stages.
class Adjustment {
 public:
  Adjustment(BundleProblem* problem, const BundleParams& params) : problem_(problem), params_(params) {
    SelectParts();
    for (const BundleView& view : problem->views) poses_.push_back(BlockOf(view.T_camera_object));
  }

  BundleReport Run() {
    BundleReport report;
    report.observations = static_cast<int>(used_.size());
    report.points = static_cast<int>(std::count(point_free_.begin(), point_free_.end(), true));
    report.views = static_cast<int>(std::count(view_free_.begin(), view_free_.end(), true));
    report.initial_cost = report.final_cost = Cost();
    report.converged = true;
    const std::vector<Eigen::Vector2d> before = Errors();
    if (report.points + report.views > 0) {
      const std::vector<PoseBlock> first_poses = poses_;
      const std::vector<Eigen::Vector3d> first_points = problem_->points;
      Solve(&report);
      report.final_cost = Cost();
      if (!(report.final_cost <= report.initial_cost)) {
        poses_ = first_poses;
        problem_->points = first_points;
        report.final_cost = report.initial_cost;
      }
      for (size_t v = 0; v < poses_.size(); ++v) {
        if (view_free_[v]) problem_->views[v].T_camera_object = RigidOf(poses_[v]);
      }
    }
    Summarise(before, &report);
    return report;
  }

 private:
  bool IsUsable(const BundleObservation& observation) const {
    if (observation.view < 0 || observation.view >= static_cast<int>(problem_->views.size())) return false;
    if (observation.point < 0 || observation.point >= static_cast<int>(problem_->points.size())) return false;
    const BundleView& view = problem_->views[observation.view];
    const Eigen::Vector3d p = view.T_camera_object * problem_->points[observation.point];
    return observation.pixel.allFinite() && p.allFinite() && p.z() > kMinDepth && std::isfinite(observation.depth_m);
  }

  bool IsFree(int view) const {
    return !problem_->views[view].fixed && view != held_view_ && problem_->views[view].T_camera_object.matrix().allFinite();
  }

  bool IsUsable(const BundleRelation& relation) const {
    const int count = static_cast<int>(problem_->views.size());
    const int a = relation.view_a, b = relation.view_b;
    if (a < 0 || b < 0 || a >= count || b >= count || a == b) return false;
    return relation.T_b_a.matrix().allFinite() && relation.information.allFinite() &&
           problem_->views[a].T_camera_object.matrix().allFinite() && problem_->views[b].T_camera_object.matrix().allFinite();
  }

  // Points need two views, one of them free; free views need three such points, a relation or a prior. What one loses the other may
  // lose by it.
  void SelectParts() {
    const auto& views = problem_->views;
    const bool anchored = std::any_of(views.begin(), views.end(), [](const BundleView& v) { return v.fixed || v.prior; });
    for (const BundleObservation& o : problem_->observations) {
      if (IsUsable(o)) used_.push_back(&o);
    }
    std::vector<bool> related(views.size(), false);
    for (const BundleRelation& relation : problem_->relations) {
      if (!IsUsable(relation)) continue;
      relations_.push_back(&relation);
      related[relation.view_a] = related[relation.view_b] = true;
    }
    for (size_t v = 0; !anchored && held_view_ < 0 && v < views.size(); ++v) {
      const bool takes_part = std::any_of(used_.begin(), used_.end(), [&](auto* o) { return o->view == int(v); });
      if (takes_part || related[v]) held_view_ = static_cast<int>(v);
    }
    view_free_.assign(views.size(), false);
    for (size_t v = 0; v < views.size(); ++v) view_free_[v] = IsFree(static_cast<int>(v));
    for (bool changed = true; changed;) {
      changed = false;
      std::vector<std::set<int>> seen_by(problem_->points.size());
      for (const auto* o : used_) seen_by[o->point].insert(o->view);
      point_free_.assign(problem_->points.size(), false);
      for (size_t p = 0; p < seen_by.size(); ++p) {
        point_free_[p] =
            seen_by[p].size() >= 2 && std::any_of(seen_by[p].begin(), seen_by[p].end(), [&](int v) { return bool(view_free_[v]); });
      }
      used_.erase(std::remove_if(used_.begin(), used_.end(), [&](auto* o) { return !point_free_[o->point]; }), used_.end());
      std::vector<int> count(views.size(), 0);
      for (const auto* o : used_) ++count[o->view];
      for (size_t v = 0; v < views.size(); ++v) {
        const bool keep = count[v] >= kMinObservations || views[v].prior || related[v];
        if (!view_free_[v] || keep) continue;
        view_free_[v] = false;
        // Its few observations say nothing about where it is, so they must not pull on points either.
        used_.erase(std::remove_if(used_.begin(), used_.end(), [&](auto* o) { return o->view == int(v); }), used_.end());
        changed = true;
      }
    }
  }

  // Pixel error and depth error of every used observation, in standard deviations; NaN where no depth was measured.
  std::vector<Eigen::Vector2d> Errors() const {
    std::vector<Eigen::Vector2d> errors;
    errors.reserve(used_.size());
    for (const auto* o : used_) {
      const Seen seen(poses_[o->view].data(), problem_->points[o->point].data());
      const auto pixel = problem_->views[o->view].camera.Project(seen.p);
      const double px = pixel ? (*pixel - o->pixel).norm() / params_.pixel_sigma : kBehindSigmas;
      const double depth = o->depth_m > 0.0 ? (seen.p.z() - o->depth_m) / params_.depth_noise.Sigma(o->depth_m) : NAN;
      errors.emplace_back(px, depth);
    }
    return errors;
  }

  double Cost() const {
    const double squared_scale = params_.robust_sigmas * params_.robust_sigmas;
    const auto robust = [&](double sigmas) { return 0.5 * squared_scale * std::log1p(sigmas * sigmas / squared_scale); };
    double cost = 0.0;
    for (const Eigen::Vector2d& error : Errors()) cost += robust(error.x()) + (std::isnan(error.y()) ? 0.0 : robust(error.y()));
    for (const BundleRelation* relation : relations_) {
      if (!view_free_[relation->view_a] && !view_free_[relation->view_b]) continue;
      Vector6d residuals;
      const double* poses[2] = {poses_[relation->view_a].data(), poses_[relation->view_b].data()};
      RelationError(*relation).Evaluate(poses, residuals.data(), nullptr);
      const double scale = kRelationScales * params_.robust_sigmas;
      cost += 0.5 * scale * scale * std::log1p(residuals.squaredNorm() / (scale * scale));
    }
    for (size_t v = 0; v < poses_.size(); ++v) {
      if (!view_free_[v] || !problem_->views[v].prior) continue;
      double residuals[6];
      const double* pose = poses_[v].data();
      PriorError(*problem_->views[v].prior).Evaluate(&pose, residuals, nullptr);
      cost += 0.5 * Eigen::Map<const Eigen::Matrix<double, 6, 1>>(residuals).squaredNorm();
    }
    return cost;
  }

  // How much wider than its final value the robust scale starts: so wide that most of even the worst placed view is inside.
  double FirstAnneal() const {
    constexpr double kShare = 0.8;
    std::map<int, std::vector<double>> of_view;
    const std::vector<Eigen::Vector2d> errors = Errors();
    for (size_t i = 0; i < used_.size(); ++i) of_view[used_[i]->view].push_back(errors[i].x());
    double anneal = 1.0;
    for (auto& [view, values] : of_view) {
      const auto middle = values.begin() + static_cast<long>(kShare * (values.size() - 1));
      std::nth_element(values.begin(), middle, values.end());
      anneal = std::max(anneal, *middle / params_.robust_sigmas);
    }
    return std::min(anneal, params_.max_anneal);
  }

  void Build(ceres::Problem* ceres_problem, ceres::LossFunction* loss, ceres::LossFunction* relation_loss,
             ceres::Manifold* manifold, ceres::ParameterBlockOrdering* ordering) {
    for (const auto* o : used_) {
      double* pose = poses_[o->view].data();
      double* point = problem_->points[o->point].data();
      ceres_problem->AddResidualBlock(new PixelError(problem_->views[o->view].camera, o->pixel, params_.pixel_sigma), loss, pose,
                                      point);
      if (o->depth_m > 0.0) {
        ceres_problem->AddResidualBlock(new DepthError(o->depth_m, params_.depth_noise.Sigma(o->depth_m)), loss, pose, point);
      }
      ordering->AddElementToGroup(point, 0);
    }
    for (const BundleRelation* relation : relations_) {
      if (!view_free_[relation->view_a] && !view_free_[relation->view_b]) continue;
      ceres_problem->AddResidualBlock(new RelationError(*relation), relation_loss, poses_[relation->view_a].data(),
                                      poses_[relation->view_b].data());
    }
    for (size_t v = 0; v < poses_.size(); ++v) {
      double* pose = poses_[v].data();
      if (view_free_[v] && problem_->views[v].prior) {
        ceres_problem->AddResidualBlock(new PriorError(*problem_->views[v].prior), nullptr, pose);
      }
      if (!ceres_problem->HasParameterBlock(pose)) continue;
      ceres_problem->SetManifold(pose, manifold);
      if (!view_free_[v]) ceres_problem->SetParameterBlockConstant(pose);
      ordering->AddElementToGroup(pose, 1);
    }
  }

  void Solve(BundleReport* report) {
    PoseManifold manifold;
    ceres::LossFunctionWrapper loss(nullptr, ceres::TAKE_OWNERSHIP);
    ceres::LossFunctionWrapper relation_loss(nullptr, ceres::TAKE_OWNERSHIP);
    ceres::Problem::Options owned_here;
    owned_here.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    owned_here.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    ceres::Problem ceres_problem(owned_here);
    ceres::Solver::Options options;
    options.linear_solver_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    Build(&ceres_problem, &loss, &relation_loss, &manifold, options.linear_solver_ordering.get());
    options.linear_solver_type = ceres::DENSE_SCHUR;
    options.num_threads = 1;  // The same sums in the same order every time.
    options.logging_type = ceres::SILENT;
    int left = params_.max_iterations;
    for (double anneal = FirstAnneal(); left > 0; anneal = std::max(1.0, anneal / kStageRatio)) {
      const bool last = anneal <= 1.0;
      loss.Reset(new ceres::CauchyLoss(anneal * params_.robust_sigmas), ceres::TAKE_OWNERSHIP);
      relation_loss.Reset(new ceres::CauchyLoss(anneal * kRelationScales * params_.robust_sigmas), ceres::TAKE_OWNERSHIP);
      options.max_num_iterations = last ? left : std::min(left, kStageIterations);
      options.function_tolerance = last ? params_.tolerance : 10.0 * params_.tolerance;
      ceres::Solver::Summary summary;
      ceres::Solve(options, &ceres_problem, &summary);
      const int done = static_cast<int>(summary.iterations.size()) - 1;
      report->iterations += std::max(0, done);
      left -= std::max(1, done);
      report->converged = last && summary.termination_type == ceres::CONVERGENCE;
      if (last || summary.termination_type == ceres::FAILURE) break;
    }
  }

  void Summarise(const std::vector<Eigen::Vector2d>& before, BundleReport* report) const {
    const std::vector<Eigen::Vector2d> after = Errors();
    const double limit = kInlierScales * params_.robust_sigmas;
    int pixels = 0, depths = 0;
    double px_before = 0, px_after = 0, depth_before = 0, depth_after = 0;
    for (size_t i = 0; i < after.size(); ++i) {
      if (after[i].x() > limit) continue;
      ++pixels;
      px_before += before[i].x() * before[i].x();
      px_after += after[i].x() * after[i].x();
      if (!(std::abs(after[i].y()) <= limit)) continue;
      const double sigma_m = params_.depth_noise.Sigma(used_[i]->depth_m);
      ++depths;
      depth_before += std::pow(before[i].y() * sigma_m, 2);
      depth_after += std::pow(after[i].y() * sigma_m, 2);
    }
    const auto rms = [](double sum, int count) { return std::sqrt(sum / std::max(1, count)); };
    report->initial_rms_px = params_.pixel_sigma * rms(px_before, pixels);
    report->final_rms_px = params_.pixel_sigma * rms(px_after, pixels);
    report->initial_rms_depth_m = rms(depth_before, depths);
    report->final_rms_depth_m = rms(depth_after, depths);
    report->inlier_share = after.empty() ? 1.0 : double(pixels) / after.size();
  }

  BundleProblem* problem_;
  const BundleParams& params_;
  int held_view_ = -1;
  std::vector<const BundleObservation*> used_;
  std::vector<const BundleRelation*> relations_;
  std::vector<bool> view_free_;
  std::vector<bool> point_free_;
  std::vector<PoseBlock> poses_;
};

}  // namespace

void BundleParams::Check() const {
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(std::string("bundle: ") + what);
  };
  require(pixel_sigma > 0.0, "pixel_sigma must be > 0");
  depth_noise.Check();
  require(robust_sigmas > 0.0, "robust_sigmas must be > 0");
  require(max_iterations >= 1, "max_iterations must be >= 1");
  require(max_anneal >= 1.0, "max_anneal must be >= 1");
  require(tolerance > 0.0, "tolerance must be > 0");
}

BundleReport AdjustBundle(BundleProblem* problem, const BundleParams& params) {
  params.Check();
  return Adjustment(problem, params).Run();
}

}  // namespace vantage::pose
