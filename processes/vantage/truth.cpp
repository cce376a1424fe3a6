// vantage truth: where the camera was, from a board in the images.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <fstream>
#include <sstream>

#include "calibration/board_pose.h"
#include "common/calibration_file.h"
#include "vantage/board_file.h"
#include "vantage/sequence.h"
#include "vantage/verb.h"

namespace vantage::cli {
namespace {

struct TruthOptions {
  CommonOptions common;
  std::string board;
  std::string sequence;
  std::string frames = "all";
  std::string calibration;
  std::string out;
  double max_rms_px = 3.0;
};

struct FrameTruth {
  int id = 0;
  std::optional<calibration::BoardPose> pose;          // Where the board was seen well enough.
  std::optional<geometry::PoseDifference> difference;  // To the recording's own pose, where it knows one.
};

FrameTruth Measure(const rgbd::BopScene& scene, int id, const calibration::Board& board,
                   const std::optional<rgbd::CameraCalibration>& calibration, double max_rms_px) {
  FrameTruth truth;
  truth.id = id;
  const rgbd::Frame frame = scene.Load(id);
  if (calibration && frame.color.size() != cv::Size(calibration->camera.width, calibration->camera.height)) {
    throw std::runtime_error("--calibration is of another image size than frame " + std::to_string(id));
  }
  const rgbd::CameraCalibration camera = calibration.value_or(rgbd::CameraCalibration{frame.camera, {}});
  auto pose = calibration::EstimateBoardPose(calibration::FindBoard(rgbd::Gray(frame), board), camera);
  if (!pose || pose->rms_px > max_rms_px) return truth;
  truth.pose = pose;
  if (frame.T_world_camera) truth.difference = geometry::Difference(pose->T_camera_board.inverse(), *frame.T_world_camera);
  return truth;
}

// The recording's scene_camera.json with these poses; frames in which the board was not seen have none.
std::string WithPoses(const rgbd::BopScene& scene, const std::vector<FrameTruth>& truths) {
  std::ifstream stream(scene.folder() / "scene_camera.json");
  auto json = Json::parse(stream);
  for (const FrameTruth& truth : truths) {
    auto& entry = json[std::to_string(truth.id)];
    entry.erase("cam_R_w2c");
    entry.erase("cam_t_w2c");
    if (!truth.pose) continue;
    const geometry::Rigid& T = truth.pose->T_camera_board;
    Json R = Json::array(), t = Json::array();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) R.push_back(T.linear()(row, column));
      t.push_back(1e3 * T.translation()(row));
    }
    entry["cam_R_w2c"] = R;
    entry["cam_t_w2c"] = t;
  }
  return json.dump(1) + "\n";
}

void RunTruth(const TruthOptions& options) {
  CheckOutput(options.common);
  if (!options.out.empty()) CheckWritable(options.out);
  const calibration::Board board = LoadBoard(options.board);
  const rgbd::BopScene scene(options.sequence);
  std::optional<rgbd::CameraCalibration> calibration;
  if (!options.calibration.empty()) calibration = processes::LoadCalibration(options.calibration).calibration;
  std::vector<FrameTruth> truths;
  for (const int id : FramesOf(scene, options.frames)) truths.push_back(Measure(scene, id, board, calibration, options.max_rms_px));
  if (!options.out.empty()) WriteWhole(options.out, WithPoses(scene, truths));

  std::vector<double> rms_px, points, apart_mm, apart_deg;
  Json frames = Json::array();
  for (const FrameTruth& truth : truths) {
    Json frame{{"id", truth.id}};
    if (truth.pose) {
      rms_px.push_back(truth.pose->rms_px);
      points.push_back(truth.pose->points);
      frame["T_world_camera"] = ToJson(truth.pose->T_camera_board.inverse());
      frame["rms_px"] = truth.pose->rms_px;
      frame["points"] = truth.pose->points;
      frame["dropped_points"] = truth.pose->dropped;
    }
    if (truth.difference) {
      apart_mm.push_back(1e3 * truth.difference->translation_m);
      apart_deg.push_back(truth.difference->rotation_rad * 180.0 / M_PI);
      frame["difference_mm"] = apart_mm.back();
      frame["difference_deg"] = apart_deg.back();
    }
    frames.push_back(frame);
  }
  Json result{{"frames", truths.size()}, {"with_pose", rms_px.size()}};
  std::ostringstream text;
  char line[200];
  std::snprintf(line, sizeof line,
                "board seen in %zu of %zu frames; reprojection error %.2f px median, %.2f worst; %.0f points median\n",
                rms_px.size(), truths.size(), Quantile(rms_px, 0.5), Quantile(rms_px, 1.0), Quantile(points, 0.5));
  text << line;
  const auto quantiles = [](const std::vector<double>& values) {
    return Json{
        {"median", Number(Quantile(values, 0.5))}, {"p95", Number(Quantile(values, 0.95))}, {"max", Number(Quantile(values, 1.0))}};
  };
  result["rms_px"] = quantiles(rms_px);
  if (!apart_mm.empty()) {
    result["difference_mm"] = quantiles(apart_mm);
    result["difference_deg"] = quantiles(apart_deg);
    std::snprintf(line, sizeof line,
                  "against the recording's own poses: %.2f mm and %.3f deg median, %.2f and %.3f at 95 %%, %.2f and %.3f worst\n",
                  Quantile(apart_mm, 0.5), Quantile(apart_deg, 0.5), Quantile(apart_mm, 0.95), Quantile(apart_deg, 0.95),
                  Quantile(apart_mm, 1.0), Quantile(apart_deg, 1.0));
    text << line;
  }
  result["poses"] = frames;
  WriteResult(options.common, result, text.str());
  if (rms_px.empty()) throw std::runtime_error(options.sequence + ": the board of " + options.board + " is in none of the frames");
}

}  // namespace

void AddTruth(CLI::App& app, Run& run) {
  CLI::App* verb = app.add_subcommand("truth", "Camera poses from a calibration board in the images");
  auto options = std::make_shared<TruthOptions>();
  AddCommonOptions(*verb, options->common);
  verb->add_option("--board", options->board, "The board, YAML or JSON (README)")->required()->type_name("FILE");
  verb->add_option("--sequence", options->sequence, "BOP scene folder; its world becomes the board")->required()->type_name("DIR");
  verb->add_option("--frames", options->frames, "all, even, odd or A:B")->capture_default_str();
  verb->add_option("--calibration", options->calibration,
                   "Intrinsics and distortion; default: those of the recording, no distortion")
      ->type_name("FILE");
  verb->add_option("--max-rms-px", options->max_rms_px, "Frames with a larger reprojection error get no pose")
      ->capture_default_str();
  verb->add_option("--out", options->out, "A scene_camera.json with these poses")->type_name("FILE");
  verb->callback([options, &run] { run = [options] { RunTruth(*options); }; });
}

}  // namespace vantage::cli
