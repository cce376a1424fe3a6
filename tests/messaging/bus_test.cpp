#include "messaging/bus.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <thread>
#include <vantage/object_prior_t.hpp>
#include <vantage/operator_command_t.hpp>
#include <vantage/status_t.hpp>

#include "messaging/channels.h"
#include "messaging/node.h"
#include "messaging/run_loop.h"

namespace vantage::messaging {
namespace {

object_prior_t Prior(double probability) {
  object_prior_t prior;
  prior.utime = 1;
  prior.object = "mug";
  prior.probability = probability;
  prior.source = "test";
  return prior;
}

TEST(Bus, CarriesAMessage) {
  Bus bus("memq://");
  std::vector<double> heard;
  const auto& counts =
      bus.Subscribe<object_prior_t>(kObjectPrior, [&](const object_prior_t& m) { heard.push_back(m.probability); });
  ASSERT_TRUE(bus.Publish(kObjectPrior, Prior(0.25)));
  ASSERT_TRUE(bus.Publish(kObjectPrior, Prior(0.75)));
  EXPECT_EQ(bus.Drain(), Bus::Handled::kMessage);
  EXPECT_EQ(heard, (std::vector<double>{0.25, 0.75}));
  EXPECT_EQ(counts.received, 2);
  EXPECT_EQ(counts.bad, 0);
  EXPECT_EQ(bus.Handle(0), Bus::Handled::kNothing);
}

TEST(Bus, AnUnusableUrlIsAClearError) {
  for (const char* url : {"carrier-pigeon://home", "nonsense"}) {
    try {
      Bus bus(url);
      FAIL() << url << " was accepted";
    } catch (const std::runtime_error& error) {
      EXPECT_NE(std::string(error.what()).find(url), std::string::npos);
      EXPECT_NE(std::string(error.what()).find("udpm://"), std::string::npos);
    }
  }
}

TEST(Bus, BadBytesAndThrowingHandlersAreCounted) {
  Bus bus("memq://");
  const auto& counts = bus.Subscribe<object_prior_t>(kObjectPrior, [](const object_prior_t& m) {
    if (m.probability > 1.0) throw std::runtime_error("too probable");
  });
  bus.PublishRaw(kObjectPrior, "not a message", 13);
  operator_command_t other_type;
  other_type.utime = 1;
  bus.Publish(kObjectPrior, other_type);
  bus.Publish(kObjectPrior, Prior(7.0));
  bus.Publish(kObjectPrior, Prior(0.5));
  bus.Drain();
  EXPECT_EQ(counts.received, 1);
  EXPECT_EQ(counts.bad, 3);
  EXPECT_EQ(counts.last_error, "OBJECT_PRIOR: too probable");
}

TEST(Bus, EveryTruncationOfAMessageIsRefused) {
  Bus bus("memq://");
  int heard = 0;
  bus.Subscribe<object_prior_t>(kObjectPrior, [&](const object_prior_t&) { ++heard; });
  const object_prior_t prior = Prior(0.5);
  std::vector<unsigned char> bytes(prior.getEncodedSize());
  prior.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  for (std::size_t size = 1; size < bytes.size(); ++size) bus.PublishRaw(kObjectPrior, bytes.data(), size);
  bus.Drain();
  EXPECT_EQ(heard, 0);
}

TEST(Bus, RefusesToSendWhatWouldNotArrive) {
  Bus bus("memq://");
  object_prior_t prior = Prior(0.5);
  prior.source = std::string(kMaxMessageBytes, 'x');
  EXPECT_THROW(bus.Publish(kObjectPrior, prior), std::length_error);
}

TEST(Bus, StatusChannelsAreUpperCase) { EXPECT_EQ(StatusChannel("learner"), "LEARNER_STATUS"); }

class CountingNode : public Node {
 public:
  explicit CountingNode(Bus& bus) : Node(bus, "counter") {
    Subscribe<object_prior_t>(kObjectPrior, [this](const object_prior_t& m) {
      if (!(m.probability <= 1.0)) return Refuse(kObjectPrior, "probability above 1");
      ++heard;
      Count("priors");
    });
  }
  void Step() override {
    ++steps;
    if (fail_once) {
      fail_once = false;
      throw std::runtime_error("the step failed");
    }
  }
  bool Finished() const override { return heard >= 3; }

  int heard = 0;
  int steps = 0;
  bool fail_once = false;
};

TEST(RunNodes, EndsWhenTheNodesAreFinishedAndReportsStatus) {
  Bus bus("memq://");
  CountingNode node(bus);
  node.fail_once = true;
  status_t last;
  bus.Subscribe<status_t>("COUNTER_STATUS", [&](const status_t& status) { last = status; });
  bus.Publish(kObjectPrior, Prior(9.0));
  for (int i = 0; i < 3; ++i) bus.Publish(kObjectPrior, Prior(0.5));
  EXPECT_EQ(RunNodes(bus, {&node}, nullptr), RunEnd::kFinished);
  bus.Drain();
  EXPECT_EQ(last.process, "counter");
  EXPECT_EQ(last.bad, 1);
  EXPECT_EQ(last.last_error, "OBJECT_PRIOR: probability above 1");
  ASSERT_EQ(last.counters.size(), 2u);
  EXPECT_EQ(last.counters[0].name, "bad OBJECT_PRIOR");
  EXPECT_EQ(last.counters[0].total, 1);
  EXPECT_EQ(last.counters[1].name, "priors");
  EXPECT_EQ(last.counters[1].total, 3);
}

// Takes priors in order, and passes on what they made it think.
class OrderedNode : public Node {
 public:
  explicit OrderedNode(Bus& bus) : Node(bus, "ordered") {
    SubscribeInOrder<object_prior_t>(kObjectPrior, [this](const object_prior_t& m) {
      heard.push_back(m.utime);
      PublishDerived("THOUGHT", m);
    });
  }
  void Step() override {}
  std::vector<std::int64_t> heard;
};

TEST(Node, OlderMessagesAreRefusedUnlessTheSenderBeganAnew) {
  std::int64_t now_us = 100000000;
  Bus bus("memq://", [&] { return now_us; });
  OrderedNode node(bus);
  const auto hear = [&](std::int64_t utime) {
    object_prior_t prior = Prior(0.5);
    prior.utime = utime;
    bus.Publish(kObjectPrior, prior);
    bus.Drain();
  };
  for (const std::int64_t utime : {20000000, 20000000, 19999999, 15000000, 14999999, 15000000, 14000000}) hear(utime);
  EXPECT_EQ(node.heard, (std::vector<std::int64_t>{20000000, 20000000, 14999999, 15000000}));
  EXPECT_EQ(node.bad(), 3);
}

TEST(Node, WarningsAreOneASecond) {
  std::int64_t now_us = 1000000;
  Bus bus("memq://", [&] { return now_us; });
  CountingNode node(bus);
  ::testing::internal::CaptureStderr();
  for (int i = 0; i < 500; ++i) {
    node.NoteError("error " + std::to_string(i));
    now_us += 10000;
  }
  const std::string said = ::testing::internal::GetCapturedStderr();
  EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 5) << said;
  EXPECT_NE(said.find("error 100 (and 99 other warnings before it)"), std::string::npos) << said;
  EXPECT_EQ(node.last_error(), "error 499");
}

TEST(Node, TheStatusSaysHowOldWhatWasPublishedIs) {
  std::int64_t now_us = 10000000;
  Bus bus("memq://", [&] { return now_us; });
  OrderedNode node(bus);
  status_t last;
  bus.Subscribe<status_t>("ORDERED_STATUS", [&](const status_t& status) { last = status; });
  for (const std::int64_t utime : {9900000, 9950000, 9980000}) {
    object_prior_t prior = Prior(0.5);
    prior.utime = utime;
    bus.Publish(kObjectPrior, prior);
  }
  bus.Drain();
  node.PublishStatus();
  bus.Drain();
  ASSERT_EQ(last.latencies.size(), 1u);
  EXPECT_EQ(last.latencies[0].channel, "THOUGHT");
  EXPECT_EQ(last.latencies[0].messages, 3);
  EXPECT_EQ(last.latencies[0].median_ms, 50.0);
  EXPECT_EQ(last.latencies[0].max_ms, 100.0);
  node.PublishStatus();
  bus.Drain();
  EXPECT_EQ(last.latencies[0].messages, 0);
}

TEST(RunNodes, ASignalEndsTheWaitAtOnce) {
  Bus bus("memq://");
  CountingNode node(bus);
  StopSignals signals;
  const pid_t self = getpid();
  std::thread sender([self] {
    usleep(100000);
    kill(self, SIGTERM);
  });
  const auto start = SystemTime_us();
  RunParams params;
  params.status_period_s = 30.0;
  params.max_wait_us = 30000000;
  EXPECT_EQ(RunNodes(bus, {&node}, &signals, params), RunEnd::kSignal);
  EXPECT_LT(SystemTime_us() - start, 5000000);
  sender.join();
}

}  // namespace
}  // namespace vantage::messaging
