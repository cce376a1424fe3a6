// The two ends of a model store that is on one host and copied to another.
#pragma once

#include <chrono>
#include <deque>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vantage/store_list_t.hpp>
#include <vantage/store_query_t.hpp>
#include <vector>

#include "messaging/store_messages.h"
#include "model/store.h"

namespace vantage::link {

// Where the store is: it is only read.
class StoreOffer {
 public:
  explicit StoreOffer(std::filesystem::path store);

  // Every object; none while there is no store yet.
  store_list_t List(const std::string& host, std::int64_t now_us);
  // The object with the images of those views that the asker does not have, in parts; empty where there is no such object. Throws
  // std::runtime_error as Store does.
  std::vector<store_part_t> Answer(const store_query_t& query);

 private:
  bool Open();

  std::filesystem::path file_;
  std::optional<model::Store> store_;
};

// The copy.
class StoreCopy {
 public:
  explicit StoreCopy(std::filesystem::path store);

  // What to ask for, given what there is: the first object that is missing or older; nullopt where all is copied. Objects that are
  // no more are removed.
  std::optional<store_query_t> Compare(const store_list_t& list);
  // An object that came whole. Throws std::runtime_error where it is damaged, or the copy cannot be written.
  void Save(const std::vector<std::uint8_t>& bytes, std::int64_t revision);

  int objects() const { return static_cast<int>(revisions_.size()); }

 private:
  std::filesystem::path file_;
  model::Store store_;
  std::map<std::string, std::int64_t> revisions_;  // Of the original, as copied since this process began.
};

}  // namespace vantage::link
