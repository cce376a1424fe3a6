// Clocks of several hosts, and a store that is copied between them.
#include <gtest/gtest.h>

#include "../model/random_model.h"
#include "link/node.h"
#include "messaging/channels.h"
#include "messaging/run_loop.h"
#include "support/temp_folder.h"

namespace vantage::link {
namespace {

TEST(HostClocks, OffsetIsFoundThroughUnevenDelays) {
  messaging::HostClocks robot("robot"), desk("desk");
  const std::int64_t ahead_us = 1234567;  // The desk's clock.
  std::mt19937 random(3);
  std::int64_t now_us = 1000000000;  // The robot's.
  for (int i = 0; i < 20; ++i) {
    const auto there_us = static_cast<std::int64_t>(300 + random() % 3000),
               back_us = static_cast<std::int64_t>(300 + random() % 3000);
    desk.Hear(robot.Say(now_us), now_us + there_us + ahead_us);
    now_us += 500000;
    robot.Hear(desk.Say(now_us + ahead_us), now_us + back_us);
    now_us += 500000;
  }
  const auto seen = robot.Offsets(now_us);
  ASSERT_EQ(seen.size(), 1u);
  EXPECT_EQ(seen[0].host, "desk");
  EXPECT_NEAR(seen[0].offset_ms, 1234.567, 0.5 * seen[0].delay_ms);
  EXPECT_NEAR(seen[0].offset_ms, 1234.567, 1.0);
  EXPECT_NEAR(desk.Offsets(now_us + ahead_us)[0].offset_ms, -1234.567, 1.0);
  EXPECT_TRUE(robot.Offsets(now_us + 11000000).empty()) << "who is silent is forgotten";
  robot.Hear(robot.Say(now_us), now_us);
  EXPECT_EQ(robot.Say(now_us).count, 1) << "oneself is no other host";
}

class LinkTest : public ::testing::Test {
 protected:
  LinkTest() : original_(folder_ / "original.db"), copy_(folder_ / "copy.db") {}

  LinkParams Params(const std::string& host) const {
    LinkParams params;
    params.host = host;
    params.period_s = 0.05;
    params.part_pause_s = 0.0;
    params.patience_s = 0.2;
    (host == "robot" ? params.offer : params.copy) = (host == "robot" ? original_ : copy_).string();
    return params;
  }
  std::int64_t CopiedViews(const std::string& name) const {
    if (!std::filesystem::exists(copy_)) return 0;
    const auto object = model::Store(copy_, model::Store::Mode::kRead).Load(name);
    return object ? static_cast<std::int64_t>(object->views.size()) : 0;
  }
  // Until `done`, 20 s at most.
  static bool Run(messaging::Bus& bus, const std::vector<messaging::Node*>& nodes, const std::function<bool()>& done) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    messaging::RunParams run;
    bool reached = false;
    run.until = [&] { return (reached = done()) || std::chrono::steady_clock::now() > end; };
    messaging::RunNodes(bus, nodes, nullptr, run);
    return reached;
  }

  testing::TempFolder folder_;
  std::filesystem::path original_, copy_;
};

TEST_F(LinkTest, TheCopyFollowsTheStore) {
  messaging::Bus bus("memq://");
  LinkNode desk(bus, Params("desk"));  // First: the store is not even there.
  LinkNode robot(bus, Params("robot"));
  std::mt19937 random(1);
  auto box = model::RandomModel("box", 12), cup = model::RandomModel("cup", 2);
  model::Store original(original_, model::Store::Mode::kWrite);
  original.SaveObject(box);
  original.SaveObject(cup);
  ASSERT_TRUE(Run(bus, {&robot, &desk}, [&] { return CopiedViews("box") == 12 && CopiedViews("cup") == 2; }));
  model::ExpectSame(*original.Load("box"), *model::Store(copy_, model::Store::Mode::kRead).Load("box"));

  // Only what is new travels.
  std::int64_t sent_bytes = 0;
  bus.SetTap([&](const std::string& channel, const void*, std::size_t size) {
    EXPECT_LT(size, 190000u);
    if (channel == messaging::kLinkPart) sent_bytes += static_cast<std::int64_t>(size);
  });
  model::GrowModel(box, random);
  original.Update(box);
  original.SaveMeasures("box", box.measures, 0.61);
  ASSERT_TRUE(Run(bus, {&robot, &desk}, [&] { return CopiedViews("box") == 13; }));
  const model::Store copy(copy_, model::Store::Mode::kRead);
  ASSERT_TRUE(Run(bus, {&robot, &desk}, [&] { return copy.Completeness("box").has_value(); }));
  EXPECT_DOUBLE_EQ(*copy.Completeness("box"), 0.61);
  model::ExpectSame(*original.Load("box"), *copy.Load("box"));
  EXPECT_GT(sent_bytes, 0);

  original.Remove("cup");
  EXPECT_TRUE(Run(bus, {&robot, &desk}, [&] { return copy.List().size() == 1; }));
  EXPECT_EQ(desk.bad(), 0);
  EXPECT_EQ(desk.last_error(), "");
}

TEST_F(LinkTest, AnObjectLearnedAnewReplacesTheOld) {
  messaging::Bus bus("memq://");
  LinkNode desk(bus, Params("desk")), robot(bus, Params("robot"));
  model::Store original(original_, model::Store::Mode::kWrite);
  original.SaveObject(model::RandomModel("box", 3));
  ASSERT_TRUE(Run(bus, {&robot, &desk}, [&] { return CopiedViews("box") == 3; }));
  auto other = model::RandomModel("box", 3, 99);
  for (auto& view : other.views) view.utime += 1000000;
  original.SaveObject(other);
  const auto same = [&] {
    const auto object = model::Store(copy_, model::Store::Mode::kRead).Load("box");
    return object && object->views.front().utime == other.views.front().utime;
  };
  ASSERT_TRUE(Run(bus, {&robot, &desk}, same));
  model::ExpectSame(*original.Load("box"), *model::Store(copy_, model::Store::Mode::kRead).Load("box"));
}

// What comes wrong, or not at all, is asked for again; the copy never holds half an object.
TEST_F(LinkTest, LostAndWrongPartsAreAskedForAgain) {
  messaging::Bus bus("memq://");
  LinkNode desk(bus, Params("desk"));
  std::vector<store_query_t> asked;
  bus.Subscribe<store_query_t>(messaging::kLinkQuery, [&](const store_query_t& query) {
    if (!query.object.empty()) asked.push_back(query);
    store_list_t list;
    list.utime = 1;
    list.host = "robot";
    list.count = 1;
    list.entries.resize(1);
    list.entries[0].object = "box";
    list.entries[0].revision = 5;
    if (query.object.empty()) bus.Publish(messaging::kLinkList, list);
  });
  ASSERT_TRUE(Run(bus, {&desk}, [&] { return asked.size() >= 2; })) << "nobody answered: it asks again";
  EXPECT_NE(asked[0].request, asked[1].request);
  auto parts = messaging::SplitStore(asked.back().request, 5, std::vector<std::uint8_t>(400000, 7));
  ASSERT_EQ(parts.size(), 3u);
  parts[1].total_size = 1;
  for (const auto& part : parts) bus.Publish(messaging::kLinkPart, part);
  const auto before = asked.size();
  ASSERT_TRUE(Run(bus, {&desk}, [&] { return asked.size() > before; }));
  for (const auto& part : messaging::SplitStore(asked.back().request, 5, std::vector<std::uint8_t>(400000, 7))) {
    bus.Publish(messaging::kLinkPart, part);  // Whole, but no store.
  }
  ASSERT_TRUE(Run(bus, {&desk}, [&] { return asked.size() > before + 1; }));
  EXPECT_GE(desk.bad(), 1);
  EXPECT_FALSE(desk.last_error().empty());
  EXPECT_EQ(CopiedViews("box"), 0);
}

}  // namespace
}  // namespace vantage::link
