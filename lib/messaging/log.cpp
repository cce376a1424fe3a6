#include "messaging/log.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <stdexcept>

namespace vantage::messaging {
namespace {

constexpr std::array<std::uint8_t, 4> kSync = {0xED, 0xA1, 0xDA, 0x01};
constexpr std::int64_t kHeadBytes = 28;
constexpr std::int64_t kMaxChannelBytes = 63;  // As LCM itself.
constexpr std::int64_t kChunkBytes = 1 << 16;

template <typename Number>
Number BigEndian(const std::uint8_t* bytes) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < sizeof(Number); ++i) value = (value << 8) | bytes[i];
  return static_cast<Number>(value);
}

template <typename Number>
void AppendBigEndian(Number number, std::string& bytes) {
  const auto value = static_cast<std::uint64_t>(number);
  for (int shift = 8 * static_cast<int>(sizeof(Number)) - 8; shift >= 0; shift -= 8) {
    bytes.push_back(static_cast<char>((value >> shift) & 0xFF));
  }
}

}  // namespace

LogReader::LogReader(const std::filesystem::path& file) : file_(file) {
  std::error_code failed;
  if (!std::filesystem::exists(file, failed)) throw std::runtime_error(file.string() + ": no such log");
  const bool is_file = std::filesystem::is_regular_file(file, failed);
  if (is_file) stream_.open(file, std::ios::binary);  // A pipe would wait for ever.
  bytes_ = static_cast<std::int64_t>(std::filesystem::file_size(file, failed));
  if (failed || !is_file || !stream_)
    throw std::runtime_error(file.string() + ": cannot be read; is it a file, are you allowed to?");
  if (bytes_ > 0 && FindHead(0, bytes_) == bytes_) {
    throw std::runtime_error(file.string() + ": is no LCM log (there is no event in it); lcm-logger and scripts/record make one");
  }
}

void LogReader::Rewind() {
  offset_ = 0;
  damage_ = {};
}

std::vector<std::uint8_t> LogReader::ReadAt(std::int64_t offset, std::int64_t count) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(count));
  stream_.clear();
  stream_.seekg(offset);
  stream_.read(reinterpret_cast<char*>(bytes.data()), count);
  if (stream_.gcount() != count) throw std::runtime_error(file_.string() + ": cannot be read at byte " + std::to_string(offset));
  return bytes;
}

std::optional<LogReader::Head> LogReader::HeadAt(std::int64_t offset) {
  if (offset + kHeadBytes > bytes_) return std::nullopt;
  const auto head = ReadAt(offset, std::min(kHeadBytes + kMaxChannelBytes, bytes_ - offset));
  if (!std::equal(kSync.begin(), kSync.end(), head.begin())) return std::nullopt;
  const std::int64_t channel_bytes = BigEndian<std::uint32_t>(&head[20]);
  const std::int64_t data_bytes = BigEndian<std::uint32_t>(&head[24]);
  if (channel_bytes < 1 || channel_bytes > kMaxChannelBytes || data_bytes > kMaxDataBytes) return std::nullopt;
  if (kHeadBytes + channel_bytes > static_cast<std::int64_t>(head.size())) return std::nullopt;
  Head result;
  result.event.number = BigEndian<std::int64_t>(&head[4]);
  result.event.time_us = BigEndian<std::int64_t>(&head[12]);
  result.event.channel.assign(head.begin() + kHeadBytes, head.begin() + kHeadBytes + channel_bytes);
  for (const unsigned char c : result.event.channel) {
    if (!std::isprint(c)) return std::nullopt;
  }
  result.end = offset + kHeadBytes + channel_bytes + data_bytes;
  return result;
}

std::int64_t LogReader::FindHead(std::int64_t offset, std::int64_t end) {
  while (offset < end) {
    // Chunks overlap by a sync word less one byte.
    const auto chunk = ReadAt(offset, std::min(kChunkBytes, bytes_ - offset));
    for (auto at = chunk.begin();; ++at) {
      at = std::search(at, chunk.end(), kSync.begin(), kSync.end());
      const std::int64_t found = offset + (at - chunk.begin());
      if (at == chunk.end() || found >= end) break;
      if (HeadAt(found)) return found;
    }
    if (static_cast<std::int64_t>(chunk.size()) < kChunkBytes) break;
    offset += kChunkBytes - static_cast<std::int64_t>(kSync.size()) + 1;
  }
  return end;
}

void LogReader::Skip(std::int64_t to) {
  if (damage_.first_offset < 0) damage_.first_offset = offset_;
  ++damage_.places;
  damage_.skipped_bytes += to - offset_;
  offset_ = to;
}

std::optional<LogEvent> LogReader::Next() {
  while (offset_ < bytes_) {
    auto head = HeadAt(offset_);
    if (!head) {
      const std::int64_t next = FindHead(offset_ + 1, bytes_);
      damage_.cut_off |= next == bytes_ && bytes_ - offset_ < kHeadBytes + kMaxChannelBytes;
      Skip(next);
      continue;
    }
    // An event is whole where the file ends or goes on behind it; else another begins inside it, or its size is wrong.
    const bool goes_on = head->end == bytes_ || (head->end < bytes_ && HeadAt(head->end));
    if (!goes_on) {
      const std::int64_t inside = FindHead(offset_ + 1, std::min(head->end, bytes_));
      if (inside < std::min(head->end, bytes_) || head->end > bytes_) {
        damage_.cut_off |= inside == bytes_;
        Skip(inside);
        continue;
      }
    }
    const std::int64_t data_at = offset_ + kHeadBytes + static_cast<std::int64_t>(head->event.channel.size());
    head->event.data = ReadAt(data_at, head->end - data_at);
    offset_ = head->end;
    return std::move(head->event);
  }
  return std::nullopt;
}

LogWriter::LogWriter(const std::filesystem::path& file) : file_(file) {
  std::error_code ignored;
  if (std::filesystem::exists(file, ignored)) throw std::runtime_error(file.string() + ": exists; choose another name");
  stream_.open(file, std::ios::binary);
  if (!stream_) throw std::runtime_error(file.string() + ": cannot be written; is its folder there, are you allowed to?");
}

void LogWriter::Write(std::int64_t time_us, const std::string& channel, const void* data, std::size_t size) {
  std::string head(kSync.begin(), kSync.end());
  AppendBigEndian(events_++, head);
  AppendBigEndian(time_us, head);
  AppendBigEndian(static_cast<std::uint32_t>(channel.size()), head);
  AppendBigEndian(static_cast<std::uint32_t>(size), head);
  head += channel;
  stream_.write(head.data(), static_cast<std::streamsize>(head.size()));
  stream_.write(static_cast<const char*>(data), static_cast<std::streamsize>(size));
  if (!stream_) throw std::runtime_error(file_.string() + ": cannot be written; is the disk full?");
}

void LogWriter::Close() {
  stream_.close();
  if (!stream_) throw std::runtime_error(file_.string() + ": cannot be written; is the disk full?");
}

}  // namespace vantage::messaging
