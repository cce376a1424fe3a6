#include "model/store.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <random>
#include <thread>

#include "../model/random_model.h"
#include "measures/text.h"

namespace vantage::model {
namespace {

namespace fs = std::filesystem;

// A folder of its own for every test.
class StoreTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) /
              ("vantage_store_" + std::to_string(::getpid()) + "_" + testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    file_ = folder_ / "models.db";
  }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path folder_;
  fs::path file_;
};

template <typename Action>
std::string ErrorOf(const Action& action) {
  try {
    action();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

bool Contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST_F(StoreTest, WhatIsSavedComesBackToTheLastBit) {
  const ObjectModel box = RandomModel("cracker box", 3);
  ObjectModel bare = RandomModel("no depth", 1, 8);
  bare.views[0].keyframe.depth = cv::Mat();
  bare.views[0].mask = cv::Mat();
  {
    Store store(file_, Store::Mode::kWrite);
    store.SaveObject(box);
    store.SaveObject(bare);
  }
  Store(file_, Store::Mode::kRead).List();
  EXPECT_FALSE(fs::exists(file_.string() + "-wal")) << "a store that was closed is one file";
  const Store store(file_, Store::Mode::kRead);
  const std::optional<ObjectModel> loaded = store.Load("cracker box");
  ASSERT_TRUE(loaded);
  ExpectSame(*loaded, box);
  ExpectSame(store.Load("no depth").value(), bare);
  EXPECT_FALSE(store.Load("mug"));
  EXPECT_THROW(Store(file_, Store::Mode::kRead).SaveObject(box), std::runtime_error) << "a reader does not write";
  const std::vector<Store::Summary> list = store.List();
  ASSERT_EQ(list.size(), 2u);
  EXPECT_EQ(list[0].name, "cracker box");
  EXPECT_EQ(list[0].views, 3);
  EXPECT_EQ(list[0].points, 90);
  EXPECT_EQ(list[0].utime, 1002);
}

TEST_F(StoreTest, UpdateFollowsWhatRefinementMovedAndUpkeepDropped) {
  std::mt19937 random(kSeed);
  ObjectModel model = RandomModel("box", 0);
  Store store(file_, Store::Mode::kWrite);
  std::int64_t revision = 0;
  const auto expect_stored = [&] {
    store.Update(model);
    ExpectSame(store.Load("box").value(), model);
    const std::int64_t now = store.List().at(0).revision;
    EXPECT_GT(now, revision);
    revision = now;
  };
  for (int i = 0; i < 4; ++i) {
    GrowModel(model, random);
    model.views[0].T_camera_object.translation().x() += 0.01;
    model.views[0].points[3] = static_cast<int>(model.points.size()) - 1;  // A link by loop closure.
    expect_stored();
  }
  View& thinned = model.views[2];
  thinned.features = features::Select(thinned.features, {0, 5, 7});
  thinned.points = {thinned.points[0], thinned.points[5], thinned.points[7]};
  model.views.erase(model.views.begin() + 1);
  expect_stored();
  GrowModel(model, random);
  GrowModel(model, random);
  expect_stored();
}

TEST_F(StoreTest, UpdateThatDoesNotFitChangesNothing) {
  Store store(file_, Store::Mode::kWrite);
  const ObjectModel model = RandomModel("box", 2);
  store.SaveObject(model);
  ObjectModel another = model;
  another.views[1].utime += 1;
  EXPECT_TRUE(Contains(ErrorOf([&] { store.Update(another); }), "another object"));
  ObjectModel wrong = RandomModel("box", 3);
  wrong.views[2].points[0] = 5000;
  EXPECT_TRUE(Contains(ErrorOf([&] { store.Update(wrong); }), "view 2"));
  ExpectSame(store.Load("box").value(), model);
}

TEST_F(StoreTest, MeasuresCompletenessAndRemoval) {
  Store store(file_, Store::Mode::kWrite);
  ObjectModel model = RandomModel("box", 1);
  store.SaveObject(model);
  EXPECT_FALSE(store.Completeness("box"));
  model.measures.fingerprint = "own";
  model.measures.observed = measures::ObservedSuccess({0.7, 0.1, 20}, {0.2, 0.1, 30}, measures::Source::kOwn);
  const std::int64_t before = store.List().at(0).revision;
  store.SaveMeasures("box", model.measures, 0.625);
  EXPECT_GT(store.List().at(0).revision, before);
  EXPECT_EQ(store.Completeness("box"), 0.625);
  ExpectSame(store.Load("box").value(), model);
  std::mt19937 random(1);
  GrowModel(model, random);
  store.Update(model);
  EXPECT_EQ(store.Completeness("box"), 0.625);
  ExpectSame(store.Load("box").value(), model);
  const std::int64_t last = store.List().at(0).revision;
  store.Remove("box");
  EXPECT_FALSE(store.Load("box"));
  EXPECT_TRUE(store.List().empty());
  store.SaveObject(model);
  EXPECT_GT(store.List().at(0).revision, last) << "an object learned anew must not look unchanged";
  EXPECT_FALSE(store.Completeness("box"));
  EXPECT_TRUE(Contains(ErrorOf([&] { store.SaveMeasures("mug", model.measures, 0); }), "mug"));
}

// A writer is killed at a random moment while it adds views: the store holds every view that was reported as stored, whole.
TEST_F(StoreTest, AKilledWriterLeavesWholeViews) {
  for (int round = 0; round < 4; ++round) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    int report[2];
    ASSERT_EQ(::pipe(report), 0);
    const pid_t child = ::fork();
    if (child == 0) {
      std::mt19937 random(kSeed);
      ObjectModel model;
      model.name = "box";
      Store store(file_, Store::Mode::kWrite);
      for (int i = 0; i < 500; ++i) {
        GrowModel(model, random);
        store.Update(model);
        if (::write(report[1], "v", 1) != 1) ::_exit(1);
      }
      ::_exit(0);
    }
    ::close(report[1]);
    char byte = 0;
    int stored = 0;
    for (; stored < 3 + round && ::read(report[0], &byte, 1) == 1; ++stored) {
    }
    std::this_thread::sleep_for(std::chrono::microseconds(700 * round));
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
    while (::read(report[0], &byte, 1) == 1) ++stored;
    ::close(report[0]);

    const ObjectModel loaded = Store(file_, Store::Mode::kRead).Load("box").value();
    ASSERT_GE(static_cast<int>(loaded.views.size()), stored);
    ASSERT_LE(static_cast<int>(loaded.views.size()), stored + 1);  // Killed between commit and report.
    ObjectModel expected = RandomModel("box", static_cast<int>(loaded.views.size()));
    expected.feature_fingerprint.clear();
    ExpectSame(loaded, expected);
    ObjectModel more = loaded;
    std::mt19937 random(1);
    GrowModel(more, random);
    Store store(file_, Store::Mode::kWrite);
    store.Update(more);
    ExpectSame(store.Load("box").value(), more);
  }
}

// A process that ends in the middle of a transaction leaves nothing of it.
TEST_F(StoreTest, AnUnfinishedTransactionLeavesNothing) {
  const ObjectModel model = RandomModel("box", 2);
  Store(file_, Store::Mode::kWrite).SaveObject(model);
  const pid_t child = ::fork();
  if (child == 0) {
    SQLite::Database database(file_.string(), SQLite::OPEN_READWRITE);
    database.exec("PRAGMA cache_spill = 1; PRAGMA cache_size = 1; BEGIN IMMEDIATE; DELETE FROM view; UPDATE object SET name = 'x'");
    ::_exit(0);
  }
  ::waitpid(child, nullptr, 0);
  ExpectSame(Store(file_, Store::Mode::kRead).Load("box").value(), model);
  ExpectSame(Store(file_, Store::Mode::kWrite).Load("box").value(), model);
}

// Readers in other processes always see whole objects, never ones that were half written.
TEST_F(StoreTest, ReadersSeeWholeTransactionsWhileTheWriterWrites) {
  std::vector<pid_t> readers;
  for (int i = 0; i < 2; ++i) {
    readers.push_back(::fork());
    if (readers.back() == 0) {
      try {
        while (!fs::exists(file_)) std::this_thread::sleep_for(std::chrono::milliseconds(1));
        const Store reader(file_, Store::Mode::kRead);
        std::size_t views = 0;
        while (views < 25) {
          const std::optional<ObjectModel> object = reader.Load("box");
          if (!object) continue;
          const ObjectModel& seen = *object;
          // Every view brings 30 points, and moves all earlier ones by a millimetre.
          if (seen.views.size() < views || seen.points.size() != 30 * seen.views.size()) ::_exit(2);
          views = seen.views.size();
          const ObjectModel expected = RandomModel("box", static_cast<int>(views));
          if (seen.points[0].position != expected.points[0].position) ::_exit(3);
        }
        ::_exit(0);
      } catch (const std::exception& error) {
        std::fprintf(stderr, "reader: %s\n", error.what());
        ::_exit(4);
      }
    }
  }
  Store store(file_, Store::Mode::kWrite);
  ObjectModel model;
  model.name = "box";
  std::mt19937 random(kSeed);
  for (int i = 0; i < 25; ++i) {
    GrowModel(model, random);
    store.Update(model);
  }
  for (const pid_t reader : readers) {
    int status = 0;
    ::waitpid(reader, &status, 0);
    EXPECT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 0);
  }
}

TEST_F(StoreTest, MissingAndForeignFilesAreRefusedAndLeftAlone) {
  EXPECT_TRUE(Contains(ErrorOf([&] { Store(file_, Store::Mode::kRead); }), file_.string() + ": no such store"));
  EXPECT_FALSE(fs::exists(file_));
  EXPECT_TRUE(Contains(ErrorOf([&] { Store(folder_, Store::Mode::kWrite); }), "is a folder"));
  EXPECT_TRUE(Contains(ErrorOf([&] { Store(folder_ / "none" / "a.db", Store::Mode::kWrite); }), "no folder"));

  const fs::path text = folder_ / "notes.txt";
  std::ofstream(text) << std::string(5000, 'x');
  const fs::path other = folder_ / "other.db";
  {
    SQLite::Database database(other.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    database.exec("CREATE TABLE tracks (id INTEGER)");
  }
  const std::uintmax_t other_size = fs::file_size(other);
  for (const Store::Mode mode : {Store::Mode::kRead, Store::Mode::kWrite}) {
    EXPECT_TRUE(Contains(ErrorOf([&] { Store(text, mode); }), "notes.txt: is not a model store (no SQLite file)"));
    EXPECT_TRUE(Contains(ErrorOf([&] { Store(other, mode); }), "other.db: is not a model store (an SQLite file of another"));
  }
  EXPECT_EQ(fs::file_size(text), 5000u);
  EXPECT_EQ(fs::file_size(other), other_size);
  EXPECT_EQ(SQLite::Database(other.string()).execAndGet("PRAGMA journal_mode").getString(), "delete");
}

TEST_F(StoreTest, AnEmptyFileBecomesAStoreOnlyWhenWritten) {
  std::ofstream(file_).close();
  EXPECT_TRUE(Contains(ErrorOf([&] { Store(file_, Store::Mode::kRead); }), "is not a model store"));
  EXPECT_EQ(fs::file_size(file_), 0u);
  Store(file_, Store::Mode::kWrite).SaveObject(RandomModel("box", 1));
  EXPECT_EQ(Store(file_, Store::Mode::kRead).List().size(), 1u);
}

TEST_F(StoreTest, ANewerSchemaIsRefused) {
  Store(file_, Store::Mode::kWrite).SaveObject(RandomModel("box", 1));
  SQLite::Database(file_.string(), SQLite::OPEN_READWRITE).exec("PRAGMA user_version = 99");
  EXPECT_TRUE(Contains(ErrorOf([&] { Store(file_, Store::Mode::kWrite); }), "schema version 99"));
}

TEST_F(StoreTest, DamageNamesObjectAndView) {
  const std::vector<std::pair<std::string, std::string>> damages = {
      {"UPDATE view SET color = substr(color, 1, 100) WHERE id = 1", "colour image"},
      {"UPDATE view SET color = zeroblob(0) || x'00' WHERE id = 1", "colour image"},
      {"UPDATE view SET depth = color WHERE id = 1", "depth image"},
      {"UPDATE view SET keypoints = substr(keypoints, 1, length(keypoints) - 5) WHERE id = 1", "keypoints"},
      {"UPDATE view SET descriptors = (SELECT descriptors FROM view WHERE id = 0) || x'00' WHERE id = 1", "descriptors"},
      {"UPDATE view SET points = t_camera_object WHERE id = 1", "points"},
      {"UPDATE view SET t_camera_object = camera WHERE id = 1", "object pose"},
      {"UPDATE view SET camera = x'' WHERE id = 1", "camera"},
  };
  for (const auto& [sql, part] : damages) {
    SCOPED_TRACE(sql);
    {
      Store store(file_, Store::Mode::kWrite);
      store.SaveObject(RandomModel("box", 2));
      store.SaveObject(RandomModel("mug", 1));
    }
    SQLite::Database(file_.string(), SQLite::OPEN_READWRITE).exec(sql);
    const Store store(file_, Store::Mode::kRead);
    const std::string error = ErrorOf([&] { store.Load("box"); });
    EXPECT_TRUE(Contains(error, file_.string() + ": object 'box': view 1 is damaged")) << error;
    EXPECT_TRUE(Contains(error, part)) << error;
    EXPECT_TRUE(store.Load("mug")) << "the others can still be read";
    fs::remove(file_);
  }
}

TEST_F(StoreTest, OverwrittenBytesAreFound) {
  Store(file_, Store::Mode::kWrite).SaveObject(RandomModel("box", 2));
  {
    std::fstream stream(file_, std::ios::in | std::ios::out | std::ios::binary);
    stream.seekp(static_cast<std::streamoff>(fs::file_size(file_) / 2));
    stream << std::string(64, '\x5a');
  }
  EXPECT_TRUE(Contains(ErrorOf([&] { Store(file_, Store::Mode::kRead).Load("box"); }), file_.string()));
}

TEST_F(StoreTest, WhatCannotBeWrittenIsSaidAtOnce) {
  const ObjectModel model = RandomModel("box", 2);
  Store(file_, Store::Mode::kWrite).SaveObject(model);
  fs::permissions(file_, fs::perms::owner_read);
  fs::permissions(folder_, fs::perms::owner_read | fs::perms::owner_exec);
  // Root may write anything, so a child gives that up first.
  const pid_t child = ::fork();
  if (child == 0) {
    if (::getuid() == 0) {
      if (::chown(folder_.c_str(), 65534, 65534) != 0 || ::chown(file_.c_str(), 65534, 65534) != 0 || ::setgid(65534) != 0 ||
          ::setuid(65534) != 0) {
        ::_exit(9);
      }
    }
    if (!Contains(ErrorOf([&] { Store(file_, Store::Mode::kWrite); }), "check the permissions")) ::_exit(1);
    if (!Contains(ErrorOf([&] { Store(folder_ / "new.db", Store::Mode::kWrite); }), "check the permissions")) ::_exit(2);
    const std::string error = ErrorOf([&] {
      if (Store(file_, Store::Mode::kRead).Load("box").value().views.size() != 2) throw std::runtime_error("no views");
    });
    if (!error.empty()) {
      std::fprintf(stderr, "%s\n", error.c_str());
      ::_exit(3);
    }
    ::_exit(0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_EQ(WEXITSTATUS(status), 0);
  fs::permissions(folder_, fs::perms::owner_all);
}

TEST_F(StoreTest, NamesWithOddCharactersAreNames) {
  const fs::path file = folder_ / "50% #1?.db";
  const std::string name = "Robert'); DROP TABLE view;--";
  Store(file, Store::Mode::kWrite).SaveObject(RandomModel(name, 1));
  EXPECT_TRUE(Store(file, Store::Mode::kRead).Load(name));
  EXPECT_THROW(Store(file, Store::Mode::kWrite).SaveObject(RandomModel("", 1)), std::invalid_argument);
}

}  // namespace
}  // namespace vantage::model
