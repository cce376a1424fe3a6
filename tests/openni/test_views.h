// The camera of driver/test_camera.cpp: the views it shows, and its commands.
#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "rgbd/bop.h"
#include "rgbd/bop_writer.h"
#include "simulation/simulated_world.h"
#include "support/temp_folder.h"

namespace vantage::testing {

// Simulated views from round the table, written once per program where the driver finds them.
class TestCamera {
 public:
  static constexpr int kViews = 4;

  TestCamera() {
    const auto params = simulation::LoadWorldParams(std::string(VANTAGE_SOURCE_DIR) + "/config/worlds/table.yaml");
    const simulation::SimulatedWorld world(params);
    rgbd::BopWriter writer(folder_ / "views");
    for (int i = 0; i < kViews; ++i) {
      const auto turn = Eigen::AngleAxisd(0.2 * i, Eigen::Vector3d::UnitZ());
      views_.push_back(world.Look(geometry::Rigid(turn) * world.StartPose(), static_cast<std::uint32_t>(i)));
      writer.Add(i, views_.back());
    }
    writer.Finish();
    ::setenv("VANTAGE_TEST_CAMERA", (folder_ / "views").c_str(), 1);
    Command("");
  }
  const std::vector<rgbd::Frame>& views() const { return views_; }
  std::filesystem::path folder() const { return folder_.path(); }

  // Lines "KEY NUMBER", as the driver takes them; what is not named is as at first.
  void Command(const std::string& lines) const {
    folder_.Write("views/control.new", lines);
    std::filesystem::rename(folder_ / "views/control.new", folder_ / "views/control");
  }

  // Which view this is; -1: none of them.
  int ViewOf(const cv::Mat& color) const {
    for (int i = 0; i < kViews; ++i) {
      if (views_[static_cast<std::size_t>(i)].color.size() == color.size() &&
          cv::norm(views_[static_cast<std::size_t>(i)].color, color, cv::NORM_INF) == 0.0)
        return i;
    }
    return -1;
  }

 private:
  TempFolder folder_;
  std::vector<rgbd::Frame> views_;
};

// Runs a test in a process of its own: OpenNI and its drivers have threads and state that outlive a test, and may crash. What
// fails there fails here.
inline void InChild(const std::function<void()>& body) {
  std::fflush(nullptr);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    ::alarm(60);
    try {
      body();
    } catch (const std::exception& error) {
      ADD_FAILURE() << "threw: " << error.what();
    }
    std::fflush(nullptr);
    _exit(::testing::Test::HasFailure() ? 1 : 0);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_FALSE(WIFSIGNALED(status)) << "signal " << WTERMSIG(status);
  ASSERT_EQ(WEXITSTATUS(status), 0);
}

}  // namespace vantage::testing
