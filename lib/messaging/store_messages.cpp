#include "messaging/store_messages.h"

#include <algorithm>

namespace vantage::messaging {

template <>
bool PlausibleBytes<store_part_t>(const void* data, std::uint32_t size) {
  static const auto header_size = static_cast<std::uint32_t>([] {
    store_part_t empty;
    empty.size = 0;
    return empty.getEncodedSize();
  }());
  if (size < header_size) return false;
  std::int32_t data_size = 0;
  __int32_t_decode_array(data, static_cast<int>(header_size) - 4, 4, &data_size, 1);
  return data_size >= 0 && static_cast<std::uint32_t>(data_size) == size - header_size;
}

std::string WhyNotAPart(const store_part_t& part) {
  if (part.total_size < 1 || part.total_size > kMaxStoreBytes) return "an object of " + std::to_string(part.total_size) + " bytes";
  if (part.parts < 1 || part.part < 0 || part.part >= part.parts) {
    return "part " + std::to_string(part.part) + " of " + std::to_string(part.parts);
  }
  if (part.size < 1 || part.size > part.total_size) return "a part of " + std::to_string(part.size) + " bytes";
  return "";
}

std::vector<store_part_t> SplitStore(std::int64_t request, std::int64_t revision, const std::vector<std::uint8_t>& bytes) {
  std::vector<store_part_t> parts;
  for (std::size_t from = 0; from < bytes.size(); from += kStorePartBytes) {
    const std::size_t to = std::min(bytes.size(), from + kStorePartBytes);
    store_part_t part;
    part.utime = 0;
    part.parts = 0;
    part.request = request;
    part.revision = revision;
    part.total_size = static_cast<std::int32_t>(bytes.size());
    part.part = static_cast<std::int16_t>(parts.size());
    part.data.assign(bytes.begin() + static_cast<std::ptrdiff_t>(from), bytes.begin() + static_cast<std::ptrdiff_t>(to));
    part.size = static_cast<std::int32_t>(part.data.size());
    parts.push_back(part);
  }
  for (auto& part : parts) part.parts = static_cast<std::int16_t>(parts.size());
  return parts;
}

Result<std::optional<std::vector<std::uint8_t>>> StoreAssembler::Add(const store_part_t& part) {
  using Bytes = std::vector<std::uint8_t>;
  using Added = Result<std::optional<Bytes>>;
  if (const std::string why = WhyNotAPart(part); !why.empty()) return Added::Error(why);
  if (parts_.empty()) {
    parts_.resize(static_cast<std::size_t>(part.parts));
    total_size_ = part.total_size;
    missing_ = part.parts;
  }
  if (static_cast<int>(parts_.size()) != part.parts || total_size_ != part.total_size) {
    return Added::Error("parts of one object that contradict each other");
  }
  Bytes& place = parts_[static_cast<std::size_t>(part.part)];
  if (!place.empty()) return std::optional<Bytes>();
  place = part.data;
  if (--missing_ > 0) return std::optional<Bytes>();
  Bytes bytes;
  for (const Bytes& piece : parts_) bytes.insert(bytes.end(), piece.begin(), piece.end());
  if (static_cast<std::int32_t>(bytes.size()) != total_size_) {
    return Added::Error("parts that are " + std::to_string(bytes.size()) + " bytes together, not " + std::to_string(total_size_));
  }
  return std::optional(std::move(bytes));
}

}  // namespace vantage::messaging
