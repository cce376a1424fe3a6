#include "link/store_ends.h"

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <stdexcept>

namespace vantage::link {
namespace {

namespace fs = std::filesystem;

// A file of its own beside `store`, gone at the end of life.
class Scratch {
 public:
  explicit Scratch(const fs::path& store) : file_(store.string() + ".link-" + std::to_string(::getpid())) { Remove(); }
  ~Scratch() { Remove(); }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  const fs::path& file() const { return file_; }

 private:
  void Remove() const {
    std::error_code ignored;
    for (const char* end : {"", "-wal", "-shm"}) fs::remove(file_.string() + end, ignored);
  }
  fs::path file_;
};

}  // namespace

StoreOffer::StoreOffer(fs::path store) : file_(std::move(store)) {}

bool StoreOffer::Open() {
  if (!store_ && fs::exists(file_)) store_.emplace(file_, model::Store::Mode::kRead);
  return store_.has_value();
}

store_list_t StoreOffer::List(const std::string& host, std::int64_t now_us) {
  store_list_t list;
  list.utime = now_us;
  list.host = host;
  if (Open()) {
    for (const auto& summary : store_->List()) {
      store_entry_t entry;
      entry.object = summary.name;
      entry.revision = summary.revision;
      list.entries.push_back(entry);
    }
  }
  list.count = static_cast<std::int16_t>(list.entries.size());
  return list;
}

std::vector<store_part_t> StoreOffer::Answer(const store_query_t& query) {
  if (!Open()) return {};
  const auto all = store_->List();
  const auto summary = std::find_if(all.begin(), all.end(), [&](const auto& one) { return one.name == query.object; });
  if (summary == all.end()) return {};
  auto object = store_->Load(query.object);
  if (!object) return {};
  for (model::View& view : object->views) {
    if (std::find(query.view_ids.begin(), query.view_ids.end(), view.id) == query.view_ids.end()) continue;
    view.keyframe.color = cv::Mat();
    view.keyframe.depth = cv::Mat();
    view.mask = cv::Mat();
  }
  const Scratch scratch(file_);
  {
    model::Store store(scratch.file(), model::Store::Mode::kWrite);
    store.SaveObject(*object);
    if (const auto completeness = store_->Completeness(query.object)) {
      store.SaveMeasures(query.object, object->measures, *completeness);
    }
  }
  std::ifstream stream(scratch.file(), std::ios::binary);
  const std::vector<std::uint8_t> bytes{std::istreambuf_iterator<char>(stream), {}};
  return messaging::SplitStore(query.request, summary->revision, bytes);
}

StoreCopy::StoreCopy(fs::path store) : file_(std::move(store)), store_(file_, model::Store::Mode::kWrite) {}

std::optional<store_query_t> StoreCopy::Compare(const store_list_t& list) {
  std::set<std::string> there;
  for (const store_entry_t& entry : list.entries) there.insert(entry.object);
  for (const auto& summary : store_.List()) {
    if (there.count(summary.name)) continue;
    store_.Remove(summary.name);
    revisions_.erase(summary.name);
  }
  for (const store_entry_t& entry : list.entries) {
    const auto copied = revisions_.find(entry.object);
    if (copied != revisions_.end() && copied->second == entry.revision) continue;
    store_query_t query;
    query.object = entry.object;
    if (const auto own = store_.Load(entry.object)) {
      for (const model::View& view : own->views) query.view_ids.push_back(view.id);
    }
    query.count = static_cast<std::int16_t>(query.view_ids.size());
    return query;
  }
  return std::nullopt;
}

void StoreCopy::Save(const std::vector<std::uint8_t>& bytes, std::int64_t revision) {
  const Scratch scratch(file_);
  std::ofstream stream(scratch.file(), std::ios::binary);
  stream.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  stream.close();
  if (!stream) throw std::runtime_error(scratch.file().string() + ": cannot be written; is the disk full?");
  const model::Store came(scratch.file(), model::Store::Mode::kRead);
  const auto all = came.List();
  if (all.size() != 1) throw std::runtime_error("an object came with " + std::to_string(all.size()) + " objects in it");
  const std::string& name = all.front().name;
  auto object = came.Load(name);
  if (!object) throw std::runtime_error("'" + name + "' came without itself");
  const auto own = store_.Load(name);
  for (model::View& view : object->views) {
    if (!view.keyframe.color.empty()) continue;
    const model::View* held = nullptr;
    if (own) {
      for (const model::View& one : own->views) {
        if (one.id == view.id && one.utime == view.utime) held = &one;
      }
    }
    if (!held) {  // Another object of that name: it is asked for from the start.
      store_.Remove(name);
      revisions_.erase(name);
      throw std::runtime_error("'" + name + "' was learned anew; it is asked for again");
    }
    view.keyframe.color = held->keyframe.color;
    view.keyframe.depth = held->keyframe.depth;
    view.mask = held->mask;
  }
  store_.SaveObject(*object);
  if (const auto completeness = came.Completeness(name)) store_.SaveMeasures(name, object->measures, *completeness);
  revisions_[name] = revision;
}

}  // namespace vantage::link
