// Whose trials the assessor runs first.
#include "assessor/node.h"

#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "messaging/assessor_messages.h"
#include "messaging/channels.h"
#include "messaging/geometry_messages.h"
#include "model/random_model.h"
#include "model/store.h"
#include "support/folder.h"

namespace vantage::assessor {
namespace {

// Views that cannot be shown, as they have no depth: their trials are over at once.
model::ObjectModel Flat(const std::string& name, int views) {
  model::ObjectModel object = model::RandomModel(name, views);
  for (model::View& view : object.views) view.keyframe.depth = cv::Mat();
  return object;
}

void Announce(messaging::Bus& bus, const model::ObjectModel& object) {
  messaging::AddedView view;
  view.object = object.name;
  view.views = static_cast<int>(object.views.size());
  view.utime = object.views.back().utime;
  view.viewpoint = object.views.back().viewpoint();
  bus.Publish(messaging::kLearnerView, messaging::ToMessage(view));
}

TEST(Assessor, NewViewsOfAnyObjectGoBeforeUnfinishedOnes) {
  const testing::TemporaryFolder folder;
  AssessorNodeParams params;
  params.store = folder / "models.db";
  const model::ObjectModel apple = Flat("apple", 2);
  model::ObjectModel box = Flat("box", 1);
  box.views[0].utime = apple.views.back().utime + 1;
  {
    model::Store store(params.store, model::Store::Mode::kWrite);
    store.SaveObject(apple);
    store.SaveObject(box);
  }
  messaging::Bus bus("memq://");
  AssessorNode node(bus, params);
  // What is published is about the object that was told of last. Its completeness goes out after every job, its measures only once
  // they count a view of it.
  int jobs = 0, jobs_until_box_counts = -1;
  bus.Subscribe<completeness_t>(messaging::kAssessorCompleteness, [&](const completeness_t&) { ++jobs; });
  bus.Subscribe<measures_t>(messaging::kAssessorMeasures, [&](const measures_t& message) {
    EXPECT_EQ(message.object, "box");
    EXPECT_EQ(message.views, 1);
    if (jobs_until_box_counts < 0) jobs_until_box_counts = jobs - 1;
  });
  Announce(bus, apple);
  Announce(bus, box);
  for (int i = 0; i < 2000 && jobs_until_box_counts < 0; ++i) {
    bus.Drain();
    node.RunStep();
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  // Two views of the apple and the box's one, each a third of its trials; the rest of the apple's is four jobs more.
  EXPECT_EQ(jobs_until_box_counts, 3) << node.last_error();
}

}  // namespace
}  // namespace vantage::assessor
