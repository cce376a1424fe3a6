// Every shipped configuration loads, and says what is the default anyway.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "assessor/node.h"
#include "learner/node.h"
#include "mount/node.h"
#include "planner/node.h"
#include "recogniser/node.h"
#include "sensor/node.h"
#include "support/folder.h"

namespace vantage {
namespace {

std::string Shipped(const std::string& name) {
  return (std::filesystem::path(VANTAGE_SOURCE_DIR) / "config" / (name + ".yaml")).string();
}

TEST(ShippedConfig, IsTheDefault) {
  const auto library = Shipped("library");
  EXPECT_EQ(mount::LoadMountParams(Shipped("mount")).rate_hz, mount::MountParams().rate_hz);
  EXPECT_EQ(mount::LoadMountParams(Shipped("mount")).limits.max_speed_m_s, mount::MountParams().limits.max_speed_m_s);
  EXPECT_EQ(sensor::LoadSensorNodeParams(Shipped("sensor")).rate_hz, sensor::SensorNodeParams().rate_hz);
  const auto learner = learner::LoadLearnerNodeParams(Shipped("learner"), library);
  EXPECT_EQ(learner.max_rate_hz, learner::LearnerNodeParams().max_rate_hz);
  EXPECT_EQ(learner.learn_in_motion, learner::LearnerNodeParams().learn_in_motion);
  const auto recogniser = recogniser::LoadRecogniserNodeParams(Shipped("recogniser"), library);
  EXPECT_EQ(recogniser.max_rate_hz, recogniser::RecogniserNodeParams().max_rate_hz);
  const auto assessor = assessor::LoadAssessorNodeParams(Shipped("assessor"), library);
  EXPECT_EQ(assessor.niceness, assessor::AssessorNodeParams().niceness);
  const auto planner = planner::LoadPlannerNodeParams(Shipped("planner"), library);
  EXPECT_EQ(planner.look_frames, planner::PlannerNodeParams().look_frames);
  EXPECT_EQ(planner.measures_wait_s, planner::PlannerNodeParams().measures_wait_s);
  // Measures fitted by the assessor hold for the learner and the recogniser.
  EXPECT_EQ(assessor.recogniser.Fingerprint(), learner.learner.recogniser.Fingerprint());
  EXPECT_EQ(assessor.recogniser.Fingerprint(), recogniser.recogniser.Fingerprint());
}

TEST(ShippedConfig, UnknownKeysAndValuesOutOfRangeNameTheFile) {
  const testing::TemporaryFolder folder;
  const auto file = folder / "bad.yaml";
  const auto error_of = [&](const std::string& text, auto load) -> std::string {
    std::ofstream(file) << text;
    try {
      load(file);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "accepted";
  };
  const auto names = [&](const std::string& error, const std::string& word) {
    return error.find(file) != std::string::npos && error.find(word) != std::string::npos;
  };
  const auto sensor = [](const std::string& f) { sensor::LoadSensorNodeParams(f); };
  const auto learner = [](const std::string& f) { learner::LoadLearnerNodeParams(f, ""); };
  const auto recogniser = [](const std::string& f) { recogniser::LoadRecogniserNodeParams(f, ""); };
  const auto assessor = [](const std::string& f) { assessor::LoadAssessorNodeParams(f, ""); };
  const auto planner = [](const std::string& f) { planner::LoadPlannerNodeParams(f, ""); };
  EXPECT_PRED2(names, error_of("sender: {jpeg_quality: 0}", sensor), "jpeg_quality");
  EXPECT_PRED2(names, error_of("rate: 3", sensor), "rate");
  EXPECT_PRED2(names, error_of("target_pixel: [1, 2, 3]", learner), "target_pixel");
  EXPECT_PRED2(names, error_of("max_rate_hz: 0", recogniser), "max_rate_hz");
  EXPECT_PRED2(names, error_of("rule: wishful", assessor), "wishful");
  EXPECT_PRED2(names, error_of("strategy: guess", planner), "strategy");
  EXPECT_PRED2(names, error_of("look_s: [1]", planner), "look_s");
}

}  // namespace
}  // namespace vantage
