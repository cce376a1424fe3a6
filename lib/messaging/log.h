// LCM logs as files: read event by event, also where the file is cut off or damaged, and written.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

namespace vantage::messaging {

// One message as the logger heard it.
struct LogEvent {
  std::int64_t number = 0;   // The logger's own count.
  std::int64_t time_us = 0;  // Microseconds since the epoch, of hearing it.
  std::string channel;
  std::vector<std::uint8_t> data;
};

// What of a log cannot be read.
struct LogDamage {
  std::int64_t places = 0;         // Runs of bytes that belong to no event.
  std::int64_t skipped_bytes = 0;  // In all of them.
  std::int64_t first_offset = -1;  // Where the first begins; -1: none.
  bool cut_off = false;            // The last event is not whole: the logger was ended hard, or the disk was full.
};

// Reads events in the order of the file. An event is 28 bytes of head (sync word 0xEDA1DA01, number, time, sizes; big endian), the
// channel's name and the data. Damaged places are passed over up to the next event and noted; nothing is made up.
class LogReader {
 public:
  static constexpr std::int64_t kMaxDataBytes = 256 << 20;  // A larger event is damage.

  // Throws std::runtime_error naming the file: no such file, a file without any event that is not empty.
  explicit LogReader(const std::filesystem::path& file);

  // The next event; nullopt at the end. Throws std::runtime_error where the disk fails.
  std::optional<LogEvent> Next();
  void Rewind();

  // Up to where was read.
  const LogDamage& damage() const { return damage_; }
  std::int64_t bytes() const { return bytes_; }  // Of the file.
  const std::filesystem::path& file() const { return file_; }

 private:
  struct Head {
    LogEvent event;
    std::int64_t end = 0;  // Offset behind the event.
  };

  std::vector<std::uint8_t> ReadAt(std::int64_t offset, std::int64_t count);
  // Head and channel of an event at this offset; nullopt where there cannot be one, wherever it ends.
  std::optional<Head> HeadAt(std::int64_t offset);
  // Where the next sync word with a credible head is, at or after `offset` and before `end`; `end` where there is none.
  std::int64_t FindHead(std::int64_t offset, std::int64_t end);
  void Skip(std::int64_t to);

  std::filesystem::path file_;
  std::ifstream stream_;
  std::int64_t bytes_ = 0;
  std::int64_t offset_ = 0;
  LogDamage damage_;
};

// Writes a log that LCM's own tools read. Events are numbered from 0.
class LogWriter {
 public:
  // Throws std::runtime_error naming the file: it exists already, its folder does not.
  explicit LogWriter(const std::filesystem::path& file);

  // Throws std::runtime_error where it cannot be written (disk full).
  void Write(std::int64_t time_us, const std::string& channel, const void* data, std::size_t size);
  void Write(const LogEvent& event) { Write(event.time_us, event.channel, event.data.data(), event.data.size()); }
  // Everything is on its way to the disk; throws like Write. Also done, without a word, at the end of life.
  void Close();

  std::int64_t events() const { return events_; }

 private:
  std::filesystem::path file_;
  std::ofstream stream_;
  std::int64_t events_ = 0;
};

}  // namespace vantage::messaging
