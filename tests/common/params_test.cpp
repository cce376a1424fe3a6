#include "common/params.h"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "common/calibration_file.h"
#include "support/temp_folder.h"

namespace vantage::params {
namespace {

const std::filesystem::path kConfig = std::filesystem::path(VANTAGE_SOURCE_DIR) / "config" / "library.yaml";

std::string ErrorOf(const std::string& text) {
  try {
    config::Mapping mapping = config::Mapping::Parse(text, "a.yaml");
    LibraryParams params;
    ReadSections(mapping, params);
    mapping.Finish();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

TEST(Params, TheShippedFileHoldsTheDefaults) {
  const std::map<std::string, std::string> shipped = Flatten(LoadLibraryParams(kConfig));
  for (const auto& [key, value] : Flatten(LibraryParams())) EXPECT_EQ(shipped.at(key), value) << key;
}

TEST(Params, TheShippedFileNamesEveryField) {
  std::ifstream stream(kConfig);
  std::ostringstream text;
  text << stream.rdbuf();
  for (const auto& [key, value] : Flatten(LibraryParams())) {
    const std::string field = key.substr(key.rfind('.') + 1);
    const std::string before = key == field ? "\n" : " ";
    EXPECT_NE(text.str().find(before + field + ":"), std::string::npos)
        << key << " (default " << value << ") is not in " << kConfig;
  }
}

TEST(Params, ValuesReachTheirStructs) {
  config::Mapping mapping = config::Mapping::Parse(
      "recogniser:\n  ransac: {inlier_px: 2.5}\n  seed: 9\nplanner: {rule: noisy_or}\ncandidates: {distances_m: [0.5, 0.8]}\n"
      "mount:\n  free:\n    workspace_lower_m: [-2, -1, 0]\n    limits: {max_speed_m_s: 0.1}\n",
      "a.yaml");
  LibraryParams params;
  ReadSections(mapping, params);
  mapping.Finish();
  EXPECT_EQ(params.recogniser.ransac.inlier_px, 2.5);
  EXPECT_EQ(params.recogniser.seed, 9u);
  EXPECT_EQ(params.learner.recogniser.ransac.inlier_px, 2.5) << "the learner recognises as the recogniser does";
  EXPECT_EQ(params.planner.rule, measures::CompletenessRule::kNoisyOr);
  EXPECT_EQ(params.candidates.distances_m, (std::vector<double>{0.5, 0.8}));
  EXPECT_EQ(params.mount.free.workspace_lower_m, Eigen::Vector3d(-2, -1, 0));
  EXPECT_EQ(params.mount.free.limits.max_speed_m_s, 0.1);
  EXPECT_NE(Flatten(params), Flatten(LibraryParams()));
}

TEST(Params, TheShippedArmIsThere) {
  const auto file = std::filesystem::path(VANTAGE_SOURCE_DIR) / "config" / "library_arm.yaml";
  const LibraryParams params = LoadLibraryParams(file);
  EXPECT_EQ(params.mount.type, "arm");
  EXPECT_TRUE(std::filesystem::exists(params.mount.arm.urdf)) << params.mount.arm.urdf << " is relative to the file";
  EXPECT_NE(ErrorOf("mount:\n  type: arm\n").find("urdf"), std::string::npos);
}

TEST(Params, TheHandEyeFileIsFoundBesideAndRefusedInOneClearLine) {
  const testing::TempFolder folder;
  processes::HandEyeFile written;
  written.T_mount_camera.linear() = Eigen::AngleAxisd(2.9, Eigen::Vector3d(1, -2, 3).normalized()).toRotationMatrix();
  written.T_mount_camera.translation() = Eigen::Vector3d(0.02, -0.06, 0.09);
  written.rms_px = 0.25;
  written.views = 11;
  folder.Write("robot/hand.yaml", processes::ToYaml(written));
  folder.Write("robot/library.yaml", "hand_eye: hand.yaml\nmount: {arm: {camera_position_m: [1, 1, 1]}}\n");
  const auto params = LoadLibraryParams(folder / "robot/library.yaml");
  const auto read = processes::LoadHandEye(params.hand_eye);
  EXPECT_TRUE(read.T_mount_camera.isApprox(written.T_mount_camera, 1e-9));
  EXPECT_EQ(read.rms_px, 0.25);
  EXPECT_EQ(read.views, 11);
  const auto& arm = params.mount.arm;
  EXPECT_TRUE(motion::CameraOnMount(arm.camera_position_m, arm.camera_rotation_rad).isApprox(written.T_mount_camera, 1e-9));

  const auto complaint = [&](const std::string& text) -> std::string {
    folder.Write("robot/hand.yaml", text);
    try {
      LoadLibraryParams(folder / "robot/library.yaml");
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  };
  const std::string head = (folder / "robot/hand.yaml").string() + ":1: T_mount_camera";
  const std::string unit = "1, 0, 0, 0,  0, 1, 0, 0,  0, 0, 1, 0,  0, 0, 0, 1";
  EXPECT_EQ(complaint("T_mount_camera: [" + unit + "]\n"), "");
  for (const auto& [text, words] : std::vector<std::pair<std::string, std::string>>{
           {"", "found none"},
           {"views: 3\n", "found none"},
           {"T_mount_camera: [1, 0, 0]\n", "16 numbers"},
           {"T_mount_camera: [" + unit + ", 0]\n", "are 17"},
           {"T_mount_camera: [1, 0, 0, 0,  0, 1, 0, 0,  0, 0, 1, 0,  0, 0, .nan, 1]\n", "finite"},
           {"T_mount_camera: [1, 0, 0, 0,  0, 1, 0, 0,  0, 0, -1, 0,  0, 0, 0, 1]\n", "no rigid transform"},
           {"T_mount_camera: [2, 0, 0, 0,  0, 2, 0, 0,  0, 0, 2, 0,  0, 0, 0, 1]\n", "no rigid transform"},
           {"T_mount_camera: [1, 0, 0, 0,  0, 1, 0, 0,  0, 0, 1, 0,  30, 20, 10, 1]\n", "no rigid transform"},
           {"T_mount_camera: [1, 0, 0, 30,  0, 1, 0, 0,  0, 0, 1, 0,  0, 0, 0, 1]\n", "expected metres"},
       }) {
    const std::string said = complaint(text);
    EXPECT_EQ(said.rfind(head, 0), 0u) << said;
    EXPECT_NE(said.find(words), std::string::npos) << said;
    EXPECT_EQ(said.find('\n'), std::string::npos) << said;
  }
  EXPECT_NE(complaint("T_mount_camera: [" + unit + "]\nfx: 500\n").find("unknown key 'fx'"), std::string::npos);
  std::filesystem::remove(folder / "robot/hand.yaml");
  try {
    LoadLibraryParams(folder / "robot/library.yaml");
    FAIL() << "a file that is not there";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("hand.yaml"), std::string::npos) << error.what();
  }
}

TEST(Params, TheShippedComparisonsAreThere) {
  const auto folder = std::filesystem::path(VANTAGE_SOURCE_DIR) / "config";
  const LibraryParams free = LoadLibraryParams(folder / "library_compare.yaml");
  const LibraryParams arm = LoadLibraryParams(folder / "library_compare_arm.yaml");
  EXPECT_EQ(arm.mount.type, "arm");
  EXPECT_TRUE(std::filesystem::exists(arm.mount.arm.urdf));
  EXPECT_EQ(arm.trials.trials_per_view, free.trials.trials_per_view);
  EXPECT_EQ(arm.planner.time_budget_s, free.planner.time_budget_s);
  EXPECT_EQ(LoadLibraryParams(folder / "library_compare_photographs.yaml").mount.type, "free");
}

TEST(Params, ErrorsNameFileAndLine) {
  EXPECT_EQ(ErrorOf("recogniser:\n  max_ration: 0.8\n").rfind("a.yaml:2: unknown key 'max_ration'", 0), 0u);
  EXPECT_EQ(ErrorOf("recogniser:\n  ransac:\n    inlier: 3\n").rfind("a.yaml:3: unknown key 'inlier'", 0), 0u);
  EXPECT_EQ(ErrorOf("planer: {}\n").rfind("a.yaml:1: unknown key 'planer'", 0), 0u);
  EXPECT_EQ(ErrorOf("planner:\n  rule: sum\n").rfind("a.yaml:2: rule", 0), 0u);
  const std::string range = ErrorOf("trials:\n  trials_per_view: 0\n");
  EXPECT_EQ(range.rfind("a.yaml:2: ", 0), 0u) << range;
  EXPECT_NE(range.find("trials_per_view"), std::string::npos) << range;
}

}  // namespace
}  // namespace vantage::params
