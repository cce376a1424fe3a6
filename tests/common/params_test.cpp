#include "common/params.h"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

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
    EXPECT_NE(text.str().find(" " + field + ":"), std::string::npos) << key << " (default " << value << ") is not in " << kConfig;
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
