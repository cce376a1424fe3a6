#include "messaging/lock_step.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <vantage/object_prior_t.hpp>
#include <vantage/operator_command_t.hpp>
#include <vantage/status_t.hpp>

#include "messaging/channels.h"

namespace vantage::messaging {
namespace {

// Answers every prior with a command, steps every 300 ms.
class Answering : public Node {
 public:
  explicit Answering(Bus& bus, bool endless = false) : Node(bus, "answering") {
    Subscribe<object_prior_t>(kObjectPrior, [this, endless](const object_prior_t& prior) {
      operator_command_t answer;
      answer.utime = now_us();
      bus_.Publish(kOperatorCommand, answer);
      if (endless) bus_.Publish(kObjectPrior, prior);
    });
  }
  void Step() override {
    if (now_us() < next_us_) return;
    next_us_ = now_us() + 300000;
    steps_us.push_back(now_us());
  }
  std::int64_t NextStep_us() const override { return next_us_; }
  std::vector<std::int64_t> steps_us;

 private:
  std::int64_t next_us_ = 0;
};

object_prior_t Prior() {
  object_prior_t prior;
  prior.utime = 1;
  prior.object = "mug";
  prior.probability = 0.5;
  return prior;
}

TEST(LockStep, TimePassesWhenItIsToldTo) {
  VirtualClock clock(1000000);
  Bus bus("memq://", clock.AsClock());
  EXPECT_FALSE(bus.real_time());
  Answering node(bus);
  LockStep steps(clock, bus, {&node});
  std::vector<std::int64_t> statuses, answers;
  bus.Subscribe<status_t>(StatusChannel("answering"), [&](const status_t& m) { statuses.push_back(m.utime); });
  bus.Subscribe<operator_command_t>(kOperatorCommand, [&](const operator_command_t& m) { answers.push_back(m.utime); });

  const Stopwatch stopwatch(bus);
  steps.PassTimeUntil(2100000);
  EXPECT_EQ(clock.now_us(), 2100000);
  EXPECT_EQ(stopwatch.ms(), 1100.0);
  EXPECT_EQ(node.steps_us, (std::vector<std::int64_t>{1001000, 1301000, 1601000, 1901000}));
  EXPECT_EQ(statuses, (std::vector<std::int64_t>{1001000, 2001000}));

  bus.Publish(kObjectPrior, Prior());
  bus.Publish(kObjectPrior, Prior());
  steps.Settle();
  EXPECT_EQ(answers, (std::vector<std::int64_t>{2100000, 2100000}));
  steps.PassTimeUntil(5);  // Never back.
  EXPECT_EQ(clock.now_us(), 2100000);
}

TEST(LockStep, LongPausesArePassedOver) {
  VirtualClock clock(0);
  Bus bus("memq://", clock.AsClock());
  Answering node(bus);
  LockStep steps(clock, bus, {&node});
  steps.PassTimeUntil(1000000LL * 3600 * 24 * 365);
  EXPECT_LT(node.steps_us.size(), 300u);
  EXPECT_GT(node.steps_us.size(), 150u);  // The last minute.
}

TEST(LockStep, AnswersWithoutAnEndAreAnError) {
  VirtualClock clock(0);
  Bus bus("memq://", clock.AsClock());
  Answering node(bus, true);
  LockStep steps(clock, bus, {&node});
  bus.Publish(kObjectPrior, Prior());
  EXPECT_THROW(steps.Settle(), std::runtime_error);
}

}  // namespace
}  // namespace vantage::messaging
