// Pieces of a store on the wire.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vantage/store_part_t.hpp>
#include <vector>

#include "messaging/bus.h"
#include "messaging/result.h"

namespace vantage::messaging {

template <>
bool PlausibleBytes<store_part_t>(const void* data, std::uint32_t size);

inline constexpr int kMaxStoreBytes = 256 << 20;
inline constexpr int kStorePartBytes = 180000;

// What contradicts itself in a part; empty where nothing does.
std::string WhyNotAPart(const store_part_t& part);

std::vector<store_part_t> SplitStore(std::int64_t request, std::int64_t revision, const std::vector<std::uint8_t>& bytes);

// Puts the parts of one answer together, in any order.
class StoreAssembler {
 public:
  // All bytes, once they are there. Errors: parts that contradict each other.
  Result<std::optional<std::vector<std::uint8_t>>> Add(const store_part_t& part);

 private:
  std::vector<std::vector<std::uint8_t>> parts_;
  std::int32_t total_size_ = 0;
  int missing_ = 0;
};

}  // namespace vantage::messaging
