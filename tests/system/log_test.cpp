// `vantage log` on a log of simulated frames.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <vantage/object_prior_t.hpp>

#include "rgbd/bop.h"
#include "simulated_log.h"
#include "support/folder.h"

namespace vantage {
namespace {

using Json = nlohmann::json;

std::string ReadAll(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

class LogVerb : public ::testing::Test {
 protected:
  static constexpr int kFrames = 6;

  // Made once: it takes seconds.
  static void SetUpTestSuite() {
    made_ = new testing::TemporaryFolder;
    testing::WriteSimulatedLog(*made_ / "log.lcm", kFrames);
  }
  static void TearDownTestSuite() {
    delete made_;
    made_ = nullptr;
  }

  int Run(const std::string& arguments) {
    const std::string command = "'" VANTAGE_PROGRAM "' log " + arguments + " >'" + out_ + "' 2>'" + err_ + "' </dev/null";
    const int status = std::system(command.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  Json Info(const std::string& log) {
    EXPECT_EQ(Run("info " + log + " --json -"), 0) << ReadAll(err_);
    return Json::parse(ReadAll(out_));
  }

  testing::TemporaryFolder folder_;
  static inline testing::TemporaryFolder* made_ = nullptr;
  const std::string log_ = *made_ / "log.lcm";
  const std::string out_ = folder_ / ".out";
  const std::string err_ = folder_ / ".err";
};

TEST_F(LogVerb, TellsWhatIsThereAndThatNothingIsMissing) {
  const Json info = Info(log_);
  EXPECT_EQ(info["channels"].size(), 3u);
  const Json color = info["channels"]["SENSOR_COLOR"];
  EXPECT_EQ(color["images"], kFrames);
  EXPECT_EQ(color["lost_images"], 0);
  EXPECT_NEAR(color["rate_hz"].get<double>(), 10.0, 1e-6);
  EXPECT_EQ(info["channels"]["MOUNT_STATE"]["type"], "mount_state_t");
  EXPECT_EQ(Run("verify " + log_), 0) << ReadAll(err_);
}

TEST_F(LogVerb, CutsAndFilters) {
  const std::string part = folder_ / "part.lcm";
  ASSERT_EQ(Run("cut " + log_ + " --from 0.15 --to 0.45 --out " + part), 0) << ReadAll(err_);
  EXPECT_EQ(Info(part)["channels"]["MOUNT_STATE"]["messages"], 3);
  EXPECT_EQ(Run("verify " + part), 0) << ReadAll(err_);
  EXPECT_EQ(Run("cut " + log_ + " --out " + part), 1);  // It exists.

  const std::string poses = folder_ / "poses.lcm";
  ASSERT_EQ(Run("filter " + log_ + " --channels '.*' --without 'SENSOR_.*' --out " + poses), 0) << ReadAll(err_);
  EXPECT_EQ(Info(poses)["events"], kFrames);
  EXPECT_EQ(Run("filter " + log_ + " --channels '(' --out " + (folder_ / "x.lcm")), 1);
  EXPECT_NE(ReadAll(err_).find("regular expression"), std::string::npos);
}

TEST_F(LogVerb, VerifyFindsWhatIsLostAndRefused) {
  const std::string bad = folder_ / "bad.lcm";
  {
    messaging::LogReader reader(log_);
    messaging::LogWriter writer(bad);
    int parts = 0;
    while (const auto event = reader.Next()) {
      if (event->channel == messaging::kSensorDepth && ++parts == 2) continue;
      writer.Write(*event);
    }
    writer.Write(testing::kLogBegin_us, messaging::kObjectPrior, "rubbish", 7);
    writer.Close();
  }
  EXPECT_EQ(Run("verify " + bad + " --json -"), 1);
  const Json found = Json::parse(ReadAll(out_));
  EXPECT_GE(found["channels"]["SENSOR_DEPTH"]["lost_images"], 1);
  EXPECT_EQ(found["channels"]["OBJECT_PRIOR"]["refused"], 1);
  EXPECT_NE(ReadAll(err_).find("bad.lcm"), std::string::npos);

  std::filesystem::resize_file(bad, std::filesystem::file_size(log_) / 2);  // As after a power cut.
  EXPECT_EQ(Run("verify " + bad), 1);
  EXPECT_NE(ReadAll(out_).find("cut off"), std::string::npos) << ReadAll(out_);
  EXPECT_EQ(Run("info " + bad), 0);
}

TEST_F(LogVerb, ExportsWhatTheOtherVerbsRead) {
  const std::string scene = folder_ / "scene";
  const std::string tables = folder_ / "tables";
  ASSERT_EQ(Run("export " + log_ + " --bop " + scene + " --csv " + tables), 0) << ReadAll(err_);
  const rgbd::BopScene read{scene};
  ASSERT_EQ(read.ids().size(), static_cast<std::size_t>(kFrames));
  const rgbd::Frame frame = read.Load(5);
  EXPECT_EQ(frame.color.cols, 640);
  EXPECT_FALSE(frame.depth.empty());
  // The sixth frame is the first after a step.
  std::istringstream rows(ReadAll(tables + "/MOUNT_STATE.csv"));
  std::string names, row;
  ASSERT_TRUE(std::getline(rows, names));
  EXPECT_EQ(names.rfind("log_time_us,utime,moving,", 0), 0u);
  int count = 0;
  while (std::getline(rows, row)) {
    ++count;
    EXPECT_EQ(std::count(row.begin(), row.end(), ','), std::count(names.begin(), names.end(), ','));
  }
  EXPECT_EQ(count, kFrames);
  EXPECT_EQ(Run("export " + log_), 1);
  EXPECT_EQ(Run("export " + log_ + " --bop " + scene), 1);  // There is a scene already.
}

}  // namespace
}  // namespace vantage
