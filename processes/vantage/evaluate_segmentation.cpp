// vantage evaluate segmentation: objects cut out of a recording's images, held against its label images and a plain method.
#include <CLI/CLI.hpp>
#include <chrono>
#include <opencv2/imgproc.hpp>

#include "rgbd/bop.h"
#include "segmentation/plane.h"
#include "vantage/overlay.h"
#include "vantage/segmentation_trial.h"
#include "vantage/sequence.h"

namespace vantage::cli {
namespace {

namespace fs = std::filesystem;

struct SegmentationOptions {
  CommonOptions common;
  std::string sequence;
  int apart = 17;
  std::string save;
};

// Images that are reported together.
struct Group {
  std::string key, title;
  SegmentationFigures ours, plain;
};

// The ways a recording is parted: what stands apart, and the hard rest with its halves, of which only one may be tuned on.
struct Groups {
  Group apart{"apart", "objects apart", {}, {}};
  Group rest{"rest", "stacked, occluded", {}, {}};
  Group rest_even{"rest_even", "  of these even (tuned on)", {}, {}};
  Group rest_odd{"rest_odd", "  of these odd (held out)", {}, {}};
  std::vector<Group*> All() { return {&apart, &rest, &rest_even, &rest_odd}; }
  std::vector<Group*> Of(int id, bool is_apart) {
    if (is_apart) return {&apart};
    return {&rest, id % 2 ? &rest_odd : &rest_even};
  }
};

double MsSince(const std::chrono::steady_clock::time_point& start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

// Truth, ours and the plain method's side by side; how many of how many were found whole.
void SavePicture(const std::string& folder, int id, const cv::Mat& color, const std::vector<std::vector<cv::Mat>>& masks,
                 const std::vector<std::string>& titles) {
  std::vector<cv::Mat> pictures;
  for (std::size_t i = 0; i < masks.size(); ++i) {
    cv::Mat picture = DrawMasks(color, masks[i]);
    for (const auto& [shade, width] : {std::pair(0, 4), std::pair(255, 1)})
      cv::putText(picture, titles[i], {10, 24}, cv::FONT_HERSHEY_SIMPLEX, 0.7, cv::Scalar::all(shade), width, cv::LINE_AA);
    pictures.push_back(picture);
  }
  cv::Mat beside;
  cv::hconcat(pictures, beside);
  char name[32];
  std::snprintf(name, sizeof name, "%06d.png", id);
  WritePicture((fs::path(folder) / name).string(), beside);
}

void Judge(const rgbd::BopScene& scene, int id, const SegmentationOptions& options, const params::LibraryParams& params,
           const std::vector<Group*>& groups) {
  const rgbd::Frame frame = scene.Load(id);
  const std::vector<cv::Mat> truth = TrueMasks(scene.LoadLabel(id));
  auto start = std::chrono::steady_clock::now();
  const auto plane = segmentation::FitPlane(frame, params.learner.plane);
  const double plane_ms = MsSince(start);
  std::vector<cv::Mat> ours, plain;
  double ours_ms = 0.0, plain_ms = 0.0;
  if (plane) {
    start = std::chrono::steady_clock::now();
    const auto clusters = segmentation::FindClusters(frame, *plane, params.learner.clusters);
    ours_ms = MsSince(start);
    for (const segmentation::Cluster& cluster : clusters) ours.push_back(cluster.mask);
    start = std::chrono::steady_clock::now();
    plain = PlainComponents(frame, *plane, params.learner.clusters.min_pixels);
    plain_ms = MsSince(start);
  }
  const auto ours_scores = ScoreSegments(ours, truth), plain_scores = ScoreSegments(plain, truth);
  for (Group* group : groups) {
    group->ours.Add(ours_scores, static_cast<int>(ours.size()), plane_ms, ours_ms);
    group->plain.Add(plain_scores, static_cast<int>(plain.size()), plane_ms, plain_ms);
  }
  if (options.save.empty()) return;
  SegmentationFigures ours_here, plain_here;
  ours_here.Add(ours_scores, 0, 0.0, 0.0);
  plain_here.Add(plain_scores, 0, 0.0, 0.0);
  const std::string of = " of " + std::to_string(truth.size());
  SavePicture(
      options.save, id, frame.color, {truth, ours, plain},
      {"truth", "clusters: " + std::to_string(ours_here.found()) + of, "plain: " + std::to_string(plain_here.found()) + of});
}

void RunEvaluateSegmentation(const SegmentationOptions& options) {
  CheckOutput(options.common);
  const params::LibraryParams params = LoadParams(options.common);
  const rgbd::BopScene scene(options.sequence);
  if (scene.ids().empty() || scene.LoadLabel(scene.ids().front()).empty())
    throw std::runtime_error(options.sequence + ": has no label images; segmentation is held against a recording with label/");
  if (!options.save.empty()) fs::create_directories(options.save);
  Groups groups;
  for (std::size_t i = 0; i < scene.ids().size(); ++i) {
    const int id = scene.ids()[i];
    Judge(scene, id, options, params, groups.Of(id, static_cast<int>(i) < options.apart));
  }
  Json result;
  std::string summary = SegmentationFigures::Header();
  for (const Group* group : groups.All()) {
    if (group->ours.objects() == 0) continue;
    result[group->key] = {{"clusters", group->ours.ToJson()}, {"plain", group->plain.ToJson()}};
    summary += group->title + "\n" + group->ours.Row("    clusters") + group->plain.Row("    plain components");
  }
  WriteResult(options.common, result, summary);
}

}  // namespace

void AddEvaluateSegmentation(CLI::App& evaluate, Run& run) {
  auto options = std::make_shared<SegmentationOptions>();
  CLI::App* verb = evaluate.add_subcommand(
      "segmentation", "Objects cut out of a recording's images against its label images, beside plain connected components");
  AddCommonOptions(*verb, options->common);
  verb->add_option("--sequence", options->sequence, "BOP scene folder with label/ (10 n .. 10 n + 9 is one object, n >= 2)")
      ->required()
      ->type_name("DIR");
  verb->add_option("--apart", options->apart,
                   "In so many of the first images objects stand apart; the others are reported by halves")
      ->check(CLI::Range(0, 1000000))
      ->capture_default_str()
      ->type_name("N");
  verb->add_option("--save", options->save,
                   "Write a picture of every image here: truth, clusters and plain components side by side")
      ->type_name("DIR");
  verb->callback([options, &run] { run = [options] { RunEvaluateSegmentation(*options); }; });
}

}  // namespace vantage::cli
