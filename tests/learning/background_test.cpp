// A job beside tracking takes effect at the stated frame, however long it takes.
#include "learning/background.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <thread>

namespace vantage::learning {
namespace {

TEST(Background, TakesEffectAtTheStatedFrameAndNoSooner) {
  Background<int> job;
  std::atomic<bool> done{false};
  job.Start(7, [&done] {
    done = true;
    return 42;
  });
  while (!done) std::this_thread::yield();
  for (int frame = 1; frame < 7; ++frame) EXPECT_FALSE(job.Take(frame)) << frame;
  EXPECT_TRUE(job.busy());
  EXPECT_EQ(job.Take(7), 42);
  EXPECT_FALSE(job.busy());
  EXPECT_FALSE(job.Take(8));
}

TEST(Background, WaitsForASlowJobAtItsFrame) {
  Background<int> job;
  std::atomic<bool> may_end{false};
  job.Start(1, [&may_end] {
    while (!may_end) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return 1;
  });
  EXPECT_FALSE(job.Take(0));
  std::thread release([&may_end] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    may_end = true;
  });
  EXPECT_EQ(job.Take(1), 1);
  EXPECT_TRUE(may_end);
  release.join();
}

TEST(Background, FinishTakesWhatIsUnderWayAndErrorsComeThrough) {
  Background<int> job;
  EXPECT_FALSE(job.Finish());
  job.Start(1000, [] { return 3; });
  EXPECT_EQ(job.Finish(), 3);
  job.Start(1, []() -> int { throw std::runtime_error("broken"); });
  EXPECT_THROW(job.Take(1), std::runtime_error);
  EXPECT_FALSE(job.busy());
}

}  // namespace
}  // namespace vantage::learning
