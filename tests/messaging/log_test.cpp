#include "messaging/log.h"

#include <gtest/gtest.h>
#include <lcm/eventlog.h>

#include <vantage/image_part_t.hpp>
#include <vantage/object_prior_t.hpp>
#include <vantage/operator_command_t.hpp>

#include "messaging/channels.h"
#include "messaging/log_summary.h"
#include "support/folder.h"

namespace vantage::messaging {
namespace {

template <typename Message>
std::vector<std::uint8_t> Bytes(const Message& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

std::vector<std::uint8_t> Prior(std::int64_t utime, double probability = 0.5) {
  object_prior_t prior;
  prior.utime = utime;
  prior.object = "mug";
  prior.probability = probability;
  prior.source = "test";
  return Bytes(prior);
}

std::vector<std::uint8_t> Part(std::int64_t sequence, int part, int parts) {
  image_part_t message;
  message.utime = 1000 * (sequence + 1);
  message.sequence = sequence;
  message.frame_id = sequence;
  message.encoding = image_part_t::JPEG;
  message.with_depth = false;
  message.camera = {};
  message.T_world_camera_known = false;
  message.T_world_camera = {};
  message.parts = static_cast<std::int16_t>(parts);
  message.part = static_cast<std::int16_t>(part);
  message.data.assign(10, 7);
  message.size = 10;
  message.total_size = 10 * parts;
  return Bytes(message);
}

struct Log {
  testing::TemporaryFolder folder;
  std::string file = folder / "log.lcm";
  LogWriter writer{file};
  std::int64_t time_us = 0;

  void Write(const std::string& channel, const std::vector<std::uint8_t>& data) {
    writer.Write(time_us += 100000, channel, data.data(), data.size());
  }
  LogSummary Summary() {
    writer.Close();
    LogReader reader(file);
    return Summarise(reader);
  }
};

std::string ReadAll(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

// The times of the events that can be read from these bytes.
std::vector<std::int64_t> Times(const std::string& bytes, LogDamage* damage = nullptr) {
  const testing::TemporaryFolder folder;
  std::ofstream(folder / "log.lcm", std::ios::binary) << bytes;
  LogReader reader(folder / "log.lcm");
  std::vector<std::int64_t> times;
  while (const auto event = reader.Next()) times.push_back(event->time_us);
  if (damage) *damage = reader.damage();
  return times;
}

// Three events of 100 bytes of data each.
struct ThreeEvents {
  ThreeEvents() {
    const testing::TemporaryFolder folder;
    LogWriter writer(folder / "log.lcm");
    for (int i = 1; i <= 3; ++i) writer.Write(i, "CHANNEL", std::string(100, static_cast<char>(i)).data(), 100);
    writer.Close();
    bytes = ReadAll(folder / "log.lcm");
    size = bytes.size() / 3;
  }
  std::string bytes;
  std::size_t size = 0;  // Of one.
};

TEST(Log, IsWhatTheToolsOfLcmReadAndWrite) {
  Log log;
  log.Write("ONE", {1, 2, 3});
  log.Write("TWO", {});
  log.writer.Close();
  lcm_eventlog_t* theirs = lcm_eventlog_create(log.file.c_str(), "r");
  ASSERT_TRUE(theirs);
  lcm_eventlog_event_t* event = lcm_eventlog_read_next_event(theirs);
  ASSERT_TRUE(event);
  EXPECT_EQ(event->eventnum, 0);
  EXPECT_EQ(event->timestamp, 100000);
  EXPECT_STREQ(event->channel, "ONE");
  ASSERT_EQ(event->datalen, 3);
  EXPECT_EQ(static_cast<const char*>(event->data)[2], 3);
  lcm_eventlog_free_event(event);
  lcm_eventlog_destroy(theirs);

  theirs = lcm_eventlog_create((log.folder / "theirs.lcm").c_str(), "w");
  char channel[] = "THEIRS";
  char data[] = "data";
  lcm_eventlog_event_t written{7, 55, 6, 4, channel, data};
  lcm_eventlog_write_event(theirs, &written);
  lcm_eventlog_destroy(theirs);
  LogReader reader(log.folder / "theirs.lcm");
  const auto read = reader.Next();
  ASSERT_TRUE(read);
  EXPECT_EQ(read->time_us, 55);
  EXPECT_EQ(read->channel, "THEIRS");
  EXPECT_EQ(std::string(read->data.begin(), read->data.end()), "data");
  EXPECT_FALSE(reader.Next());
  EXPECT_EQ(reader.damage().places, 0);
}

TEST(Log, CutOffAnywhereItGivesWhatIsWhole) {
  const ThreeEvents log;
  for (std::size_t size = 2 * log.size; size < log.bytes.size(); ++size) {
    LogDamage damage;
    EXPECT_EQ(Times(log.bytes.substr(0, size), &damage), (std::vector<std::int64_t>{1, 2})) << size;
    EXPECT_EQ(damage.cut_off, size > 2 * log.size) << size;
    EXPECT_EQ(damage.skipped_bytes, static_cast<std::int64_t>(size - 2 * log.size));
  }
}

TEST(Log, DamagedAnywhereItGivesTheOthers) {
  const ThreeEvents log;
  for (std::size_t at = log.size; at < log.size + 28; ++at) {  // In the head of the second.
    std::string bytes = log.bytes;
    bytes[at] = static_cast<char>(bytes[at] ^ 0x55);
    const auto times = Times(bytes);
    EXPECT_GE(times.size(), 2u) << at;
    EXPECT_EQ(times.front(), 1) << at;
    EXPECT_EQ(times.back(), 3) << at;
  }
  LogDamage damage;
  EXPECT_EQ(Times(log.bytes.substr(0, log.size) + std::string(100000, 'x') + log.bytes.substr(log.size), &damage),
            (std::vector<std::int64_t>{1, 2, 3}));
  EXPECT_EQ(damage.places, 1);
  EXPECT_EQ(damage.first_offset, static_cast<std::int64_t>(log.size));
  EXPECT_EQ(damage.skipped_bytes, 100000);
  EXPECT_FALSE(damage.cut_off);
}

TEST(Log, WhatIsNoneIsAClearError) {
  const testing::TemporaryFolder folder;
  EXPECT_THROW(LogReader(folder / "gone.lcm"), std::runtime_error);
  std::ofstream(folder / "text.lcm") << std::string(300000, 'a');
  EXPECT_THROW(LogReader(folder / "text.lcm"), std::runtime_error);
  std::ofstream(folder / "empty.lcm").close();
  EXPECT_FALSE(LogReader(folder / "empty.lcm").Next());
  EXPECT_THROW(LogWriter(folder / "empty.lcm"), std::runtime_error);  // Exists.
  EXPECT_THROW(LogWriter(folder / "none/a.lcm"), std::runtime_error);
}

TEST(LogSummary, AGoodLogHasNoProblems) {
  Log log;
  for (int i = 0; i < 11; ++i) {
    log.Write(kObjectPrior, Prior(i));
    log.Write(kSensorColor, Part(i, 0, 2));
    log.Write(kSensorColor, Part(i, 1, 2));
  }
  log.Write("OTHERS", {1, 2, 3});
  const auto summary = log.Summary();
  EXPECT_EQ(summary.Problems(), std::vector<std::string>());
  EXPECT_EQ(summary.UnknownChannels(), std::vector<std::string>{"OTHERS"});
  EXPECT_EQ(summary.events, 34);
  const auto& color = summary.channels.at(kSensorColor);
  EXPECT_EQ(color.type, "image_part_t");
  EXPECT_EQ(color.messages, 22);
  EXPECT_EQ(color.images, 11);
  EXPECT_NEAR(color.rate_hz(), 10 / 3.1, 1e-9);
  EXPECT_EQ(color.longest_pause_us, 200000);
  EXPECT_NEAR(summary.channels.at(kObjectPrior).rate_hz(), 10 / 3.0, 1e-9);
  EXPECT_EQ(summary.channels.at("OTHERS").type, "unknown");
}

TEST(LogSummary, LcmLoggersOwnDisorderIsNoProblem) {
  Log log;
  log.Write(kObjectPrior, Prior(1));
  log.time_us -= 140000;  // 40 ms late, as around messages in fragments.
  log.Write(kObjectPrior, Prior(2));
  const auto summary = log.Summary();
  EXPECT_EQ(summary.late_events, 1);
  EXPECT_EQ(summary.most_late_us, 40000);
  EXPECT_TRUE(summary.Problems().empty());
}

TEST(LogSummary, ALogWithNothingOfOursIsWrong) {
  Log empty, log;
  EXPECT_EQ(empty.Summary().Problems(), std::vector<std::string>{"there is nothing in this log"});
  log.Write("OTHERS", {1});
  log.Write("MORE", {1});
  EXPECT_EQ(log.Summary().Problems(), std::vector<std::string>{"none of its 2 messages is on a channel of ours"});
}

TEST(LogSummary, SaysWhatIsWrong) {
  Log log;
  log.Write(kSensorColor, Part(3, 1, 2));  // Was under way when the log began.
  log.Write(kSensorColor, Part(4, 0, 1));
  log.Write(kSensorColor, Part(7, 0, 1));  // 5 and 6 are lost...
  log.Write(kSensorColor, Part(8, 0, 2));  // ...and 8, in part.
  log.Write(kSensorColor, Part(9, 0, 1));
  log.Write(kObjectPrior, Prior(5, 2.0));
  log.Write(kObjectPrior, Part(1, 0, 1));
  log.Write(kObjectPrior, {1, 2});
  auto longer = Prior(5);
  longer.push_back(0);
  log.Write(kObjectPrior, longer);
  log.Write(kOperatorCommand, [] {
    operator_command_t command;
    command.utime = 1;
    return Bytes(command);
  }());
  log.Write(kOperatorCommand, [] {
    operator_command_t command;
    command.utime = -1;
    return Bytes(command);
  }());
  log.time_us -= 140000;
  log.Write("OTHERS", {});
  log.time_us -= 800000;
  log.Write("OTHERS", {});
  const auto summary = log.Summary();
  EXPECT_EQ(summary.channels.at(kSensorColor).lost_images, 3);
  EXPECT_EQ(summary.channels.at(kObjectPrior).refused, 4);
  EXPECT_EQ(summary.channels.at(kObjectPrior).type, "several");
  EXPECT_EQ(summary.channels.at(kOperatorCommand).backwards, 1);
  EXPECT_EQ(summary.late_events, 2);
  EXPECT_GT(summary.most_late_us, 500000);
  EXPECT_EQ(summary.Problems().size(), 4u);
}

}  // namespace
}  // namespace vantage::messaging
