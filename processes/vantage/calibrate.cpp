// vantage calibrate: a camera's intrinsics, or where it sits on the mount, from a board.
#include <CLI/CLI.hpp>
#include <iomanip>
#include <iostream>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "calibration/hand_eye.h"
#include "calibration/intrinsics.h"
#include "common/calibration_file.h"
#include "vantage/board_file.h"
#include "vantage/calibrate_views.h"
#include "vantage/verb.h"

namespace vantage::cli {
namespace {

struct CalibrateOptions {
  CommonOptions common;
  std::string board;
  std::string images;
  std::string log;
  bool live = false;
  std::string url;
  bool hand_eye = false;
  std::string calibration;
  std::string out;
  std::string picture;
  StreamParams stream;
  calibration::IntrinsicsParams intrinsics;
  calibration::HandEyeParams mount;
};

SeenBoards LookFor(const CalibrateOptions& options, const calibration::Board& board) {
  if (!options.images.empty()) return ViewsOfFolder(options.images, board);
  if (!options.log.empty()) return ViewsOfLog(options.log, board, options.stream);
  std::cerr << "hold the board still, elsewhere and tilted otherwise each time\n";
  return ViewsOfBus(options.url, board, options.stream,
                    [](int views, const std::string& text) { std::cerr << "view " << views << ": " << text << '\n'; });
}

std::string Warnings(const std::vector<std::string>& warnings) {
  std::string text;
  for (const auto& warning : warnings) text += "doubtful: " + warning + '\n';
  return text;
}

void CalibrateLens(const CalibrateOptions& options, const SeenBoards& seen) {
  std::vector<calibration::BoardView> views;
  for (const SeenBoard& view : seen.views) views.push_back(view.board);
  const cv::Size size(seen.camera.width, seen.camera.height);
  const auto result = calibration::CalibrateIntrinsics(views, size, options.intrinsics);
  processes::CalibrationFile file{result.calibration, result.rms_px, static_cast<int>(result.used.size())};
  WriteWhole(options.out, processes::ToYaml(file));
  if (!options.picture.empty() && !cv::imwrite(options.picture, calibration::DrawCoverage(views, result))) {
    throw std::runtime_error(options.picture + ": cannot be written; it is to be a .png or .jpg");
  }
  const auto& camera = result.calibration.camera;
  Json json{{"images", seen.images},
            {"views", result.used.size()},
            {"rms_px", result.rms_px},
            {"width", camera.width},
            {"height", camera.height},
            {"fx", camera.fx},
            {"fy", camera.fy},
            {"cx", camera.cx},
            {"cy", camera.cy},
            {"distortion", result.calibration.distortion},
            {"focal_sigma_px", result.focal_sigma_px},
            {"centre_sigma_px", result.centre_sigma_px},
            {"coverage", result.coverage},
            {"max_tilt_deg", result.max_tilt_deg},
            {"warnings", result.warnings}};
  std::ostringstream text;
  text << std::fixed << std::setprecision(2) << "board seen in " << seen.views.size() << " of " << seen.images << " images, "
       << result.used.size() << " used; reprojection error " << result.rms_px << " px, " << 100.0 * result.coverage
       << " % of the image covered\nfx " << camera.fx << ", fy " << camera.fy << " (+- " << result.focal_sigma_px << "), cx "
       << camera.cx << ", cy " << camera.cy << " (+- " << result.centre_sigma_px << ") px\n"
       << Warnings(result.warnings);
  WriteResult(options.common, json, text.str());
}

void CalibrateMount(const CalibrateOptions& options, const SeenBoards& seen) {
  rgbd::CameraCalibration lens{seen.camera, {}};
  if (!options.calibration.empty()) lens = processes::LoadCalibration(options.calibration).calibration;
  std::vector<calibration::HandEyeView> views;
  for (const SeenBoard& view : seen.views) {
    if (view.T_world_mount) views.push_back({*view.T_world_mount, view.board});
  }
  const auto result = calibration::CalibrateHandEye(views, lens, options.mount);
  WriteWhole(options.out, processes::ToYaml(processes::HandEyeFile{result.T_mount_camera, result.rms_px, result.views}));
  Json json{{"images", seen.images},
            {"views", result.views},
            {"T_mount_camera", ToJson(result.T_mount_camera)},
            {"T_world_board", ToJson(result.T_world_board)},
            {"rms_px", result.rms_px},
            {"position_mm", result.position_mm},
            {"rotation_deg", result.rotation_deg},
            {"turn_deg", result.turn_deg},
            {"warnings", result.warnings}};
  const Eigen::Vector3d at = 1e3 * result.T_mount_camera.translation();
  std::ostringstream text;
  text << std::fixed << std::setprecision(2) << result.views << " views of " << seen.images << " images; camera at " << at.x()
       << ", " << at.y() << ", " << at.z() << " mm of the mount\nreprojection error " << result.rms_px << " px; views disagree by "
       << result.position_mm << " mm and " << result.rotation_deg << " deg on where the board is\n"
       << Warnings(result.warnings);
  WriteResult(options.common, json, text.str());
}

void RunCalibrate(const CalibrateOptions& options) {
  CheckOutput(options.common);
  CheckWritable(options.out);
  if (!options.picture.empty()) CheckWritable(options.picture);
  if (!options.images.empty() + !options.log.empty() + options.live != 1) {
    throw std::runtime_error("say where the board is seen: one of --images DIR, --log FILE, --live");
  }
  if (options.hand_eye && !options.images.empty()) {
    throw std::runtime_error("--hand-eye needs to know where the mount was: --log FILE or --live");
  }
  if (!options.hand_eye && !options.calibration.empty()) throw std::runtime_error("--calibration is for --hand-eye");
  const calibration::Board board = LoadBoard(options.board);
  CalibrateOptions wanted = options;
  wanted.stream.with_mount = options.hand_eye;
  const SeenBoards seen = LookFor(wanted, board);
  options.hand_eye ? CalibrateMount(options, seen) : CalibrateLens(options, seen);
}

}  // namespace

void AddCalibrate(CLI::App& app, Run& run) {
  CLI::App* verb = app.add_subcommand("calibrate", "A camera's intrinsics and distortion, or where it sits on the mount");
  auto options = std::make_shared<CalibrateOptions>();
  AddCommonOptions(*verb, options->common);
  verb->add_option("--board", options->board, "The board, YAML or JSON (README)")->required()->type_name("FILE");
  verb->add_option("--images", options->images, "Images of the board, or a BOP scene folder")->type_name("DIR");
  verb->add_option("--log", options->log, "An LCM log of frames (and MOUNT_STATE)")->type_name("FILE");
  verb->add_flag("--live", options->live, "Frames (and MOUNT_STATE) from the bus, as they come");
  verb->add_option("--url", options->url, "LCM URL of the bus")->type_name("URL");
  verb->add_option("--views", options->stream.views, "Of a log or the bus: ends with so many views")->capture_default_str();
  verb->add_option("--seconds", options->stream.seconds, "...or after this time")->capture_default_str();
  verb->add_option("--distortion", options->intrinsics.distortion_terms, "Terms: 0, 2 (k1 k2), 4 (p1 p2), 5 (k3)")
      ->capture_default_str();
  verb->add_flag("--hand-eye", options->hand_eye, "T_mount_camera, from a board that stands still");
  verb->add_option("--calibration", options->calibration, "Intrinsics for --hand-eye; default: those of the frames")
      ->type_name("FILE");
  verb->add_option("--mount-sigma-mm", options->mount.mount_sigma_m, "How well the mount knows where it is...")
      ->transform([](const std::string& text) { return std::to_string(1e-3 * std::stod(text)); }, "MM")
      ->default_str("1");
  verb->add_option("--mount-sigma-deg", options->mount.mount_sigma_deg, "...and how it is turned")->capture_default_str();
  verb->add_option("--out", options->out, "YAML file for the result")->required()->type_name("FILE");
  verb->add_option("--picture", options->picture, "Where in the image the board was, and every error")->type_name("FILE");
  verb->callback([options, &run] { run = [options] { RunCalibrate(*options); }; });
}

}  // namespace vantage::cli
