#include "rgbd/codec.h"

#include <algorithm>
#include <cstddef>
#include <initializer_list>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <string>

namespace vantage::rgbd {
namespace {

constexpr std::uint8_t kMagic[] = {'R', 'V', 'L', '1'};
constexpr std::size_t kHeaderSize = 12;
constexpr int kMaxDifferencePieces = 6;  // 18 bits: any difference of two depths, with its sign.
constexpr int kMaxRunPieces = 9;         // 27 bits: all pixels of the largest image.

[[noreturn]] void Broken(const char* codec, const std::string& what) {
  throw std::runtime_error(std::string(codec) + ": " + what + "; the sender or the store is broken");
}

void CheckSides(const char* codec, std::uint32_t width, std::uint32_t height) {
  const auto good = [](std::uint32_t side) { return side >= 1 && side <= static_cast<std::uint32_t>(kMaxImageSide_px); };
  if (!good(width) || !good(height))
    Broken(codec, "expected an image of 1 to " + std::to_string(kMaxImageSide_px) + " pixels a side, found " +
                      std::to_string(width) + "x" + std::to_string(height));
}

// Numbers as 4-bit pieces: 3 bits, lowest first, and a bit that says whether more follow. Eight are gathered before they are
// stored; with the at most nine of a number they fit into 64 bits.
class PieceWriter {
 public:
  explicit PieceWriter(Bytes& bytes) : bytes_(bytes), used_(bytes.size()) {}

  // Makes room for so many numbers.
  void Reserve(std::size_t numbers) {
    const std::size_t needed = used_ + 5 * numbers + 8;
    if (bytes_.size() < needed) bytes_.resize(std::max(needed, 2 * bytes_.size()));
  }
  void Write(std::uint32_t value) {
    for (; value > 7u; value >>= 3) Put((value & 7u) | 8u);
    Put(value);
    for (; pieces_ >= 8; pieces_ -= 8) {
      const std::uint64_t word = word_ >> (4 * (pieces_ - 8));
      for (int i = 0; i < 4; ++i) bytes_[used_ + static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(word >> (24 - 8 * i));
      used_ += 4;
    }
  }
  // Stores what is left and cuts what was reserved too much; to be called once, at the end.
  void Finish() {
    bytes_.resize(used_);
    for (; pieces_ >= 2; pieces_ -= 2) bytes_.push_back(static_cast<std::uint8_t>(word_ >> (4 * (pieces_ - 2))));
    if (pieces_ == 1) bytes_.push_back(static_cast<std::uint8_t>(word_ << 4));
  }

 private:
  void Put(std::uint32_t piece) {
    word_ = word_ << 4 | piece;
    ++pieces_;
  }

  Bytes& bytes_;
  std::size_t used_;
  std::uint64_t word_ = 0;  // The newest piece lowest.
  int pieces_ = 0;
};

class PieceReader {
 public:
  explicit PieceReader(const Bytes& bytes) : bytes_(bytes), next_(2 * kHeaderSize), end_(2 * bytes.size()) {}

  std::uint32_t Read(int max_pieces) {
    std::uint32_t value = 0;
    for (int i = 0; i < max_pieces; ++i) {
      if (next_ == end_) Broken("depth", "expected more bytes, found the end");
      const std::uint8_t byte = bytes_[next_ / 2];
      const std::uint32_t piece = next_ % 2 ? byte & 15u : byte >> 4;
      ++next_;
      value |= (piece & 7u) << (3 * i);
      if (!(piece & 8u)) return value;
    }
    Broken("depth", "expected a shorter number");
  }

  // At most half a byte may be left, and it is 0.
  bool AtEnd() const { return next_ == end_ || (next_ + 1 == end_ && (bytes_.back() & 15u) == 0); }

 private:
  const Bytes& bytes_;
  std::size_t next_;  // In half bytes.
  std::size_t end_;
};

std::uint32_t ZigZag(std::int32_t value) {
  return (static_cast<std::uint32_t>(value) << 1) ^ static_cast<std::uint32_t>(value >> 31);
}

std::int32_t UnZigZag(std::uint32_t value) {
  return static_cast<std::int32_t>(value >> 1) ^ -static_cast<std::int32_t>(value & 1u);
}

void PutUint32(Bytes& bytes, std::uint32_t value) {
  for (int i = 0; i < 4; ++i) bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

std::uint32_t GetUint32(const Bytes& bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value |= static_cast<std::uint32_t>(bytes[at + i]) << (8 * i);
  return value;
}

void RequireColor(const cv::Mat& bgr) {
  if (bgr.empty() || bgr.type() != CV_8UC3) throw std::invalid_argument("colour: expected an 8-bit BGR image (CV_8UC3) to encode");
}

bool StartsWith(const Bytes& bytes, std::initializer_list<std::uint8_t> start) {
  return bytes.size() >= start.size() && std::equal(start.begin(), start.end(), bytes.begin());
}

std::uint32_t GetBigEndian(const Bytes& bytes, std::size_t at, std::size_t count) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < count; ++i) value = value << 8 | bytes[at + i];
  return value;
}

// A PNG that is whole ends with an empty IEND chunk, and starts with its size.
void CheckPng(const Bytes& bytes) {
  constexpr std::uint8_t kEnd[] = {0, 0, 0, 0, 'I', 'E', 'N', 'D', 0xAE, 0x42, 0x60, 0x82};
  if (bytes.size() < 45 || !std::equal(kEnd, kEnd + sizeof(kEnd), bytes.end() - sizeof(kEnd)))
    Broken("colour", "expected a whole PNG, found one cut off");
  CheckSides("colour", GetBigEndian(bytes, 16, 4), GetBigEndian(bytes, 20, 4));
}

// Looks for the frame header of a JPEG, so that its size is known before it is decoded.
void CheckJpeg(const Bytes& bytes) {
  // The decoder fills what is missing with grey and says nothing.
  if (bytes.size() < 4 || bytes[bytes.size() - 2] != 0xFF || bytes[bytes.size() - 1] != 0xD9)
    Broken("colour", "expected a whole JPEG, found one cut off");
  std::size_t at = 2;
  while (at + 9 < bytes.size() && bytes[at] == 0xFF) {
    const std::uint8_t marker = bytes[at + 1];
    if (marker == 0xFF) {  // A fill byte.
      ++at;
      continue;
    }
    const bool frame = marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
    if (frame) {
      CheckSides("colour", GetBigEndian(bytes, at + 7, 2), GetBigEndian(bytes, at + 5, 2));
      return;
    }
    at += 2 + GetBigEndian(bytes, at + 2, 2);
  }
  Broken("colour", "expected a JPEG with a frame header, found none");
}

}  // namespace

Bytes EncodeColor(const cv::Mat& bgr, int quality) {
  RequireColor(bgr);
  if (quality < 1 || quality > 100)
    throw std::invalid_argument("colour: JPEG quality must be in 1..100, is " + std::to_string(quality));
  Bytes bytes;
  cv::imencode(".jpg", bgr, bytes, {cv::IMWRITE_JPEG_QUALITY, quality});
  return bytes;
}

Bytes EncodeColorLossless(const cv::Mat& bgr) {
  RequireColor(bgr);
  Bytes bytes;
  cv::imencode(".png", bgr, bytes);
  return bytes;
}

cv::Mat DecodeColor(const Bytes& bytes) {
  if (StartsWith(bytes, {0xFF, 0xD8})) {
    CheckJpeg(bytes);
  } else if (StartsWith(bytes, {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'})) {
    CheckPng(bytes);
  } else {
    Broken("colour", "expected a JPEG or PNG, found something else");
  }
  cv::Mat image;
  try {
    image = cv::imdecode(bytes, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception& error) {
    Broken("colour", "expected an image, found what cannot be decoded (" + error.err + ")");
  }
  if (image.empty()) Broken("colour", "expected an image, found what cannot be decoded");
  return image;
}

Bytes EncodeDepth(const cv::Mat& depth) {
  if (depth.empty() || depth.type() != CV_16UC1 || depth.cols > kMaxImageSide_px || depth.rows > kMaxImageSide_px)
    throw std::invalid_argument("depth: expected a 16-bit image (CV_16UC1) of 1 to " + std::to_string(kMaxImageSide_px) +
                                " pixels a side to encode");
  const cv::Mat pixels = depth.isContinuous() ? depth : depth.clone();
  const std::uint16_t* at = pixels.ptr<std::uint16_t>();
  const std::uint16_t* const end = at + pixels.total();
  Bytes bytes(kMagic, kMagic + sizeof(kMagic));
  bytes.reserve(kHeaderSize + pixels.total());
  PutUint32(bytes, static_cast<std::uint32_t>(depth.cols));
  PutUint32(bytes, static_cast<std::uint32_t>(depth.rows));
  PieceWriter writer(bytes);
  std::int32_t previous = 0;
  while (at != end) {
    const std::uint16_t* run = at;
    while (at != end && *at == 0) ++at;
    writer.Reserve(2);
    writer.Write(static_cast<std::uint32_t>(at - run));
    run = at;
    while (at != end && *at != 0) ++at;
    writer.Write(static_cast<std::uint32_t>(at - run));
    writer.Reserve(static_cast<std::size_t>(at - run));
    for (; run != at; previous = *run++) writer.Write(ZigZag(*run - previous));
  }
  writer.Finish();
  return bytes;
}

cv::Mat DecodeDepth(const Bytes& bytes) {
  if (bytes.size() < kHeaderSize || !std::equal(kMagic, kMagic + sizeof(kMagic), bytes.begin()))
    Broken("depth", "expected an RVL1 image, found something else");
  const std::uint32_t width = GetUint32(bytes, 4), height = GetUint32(bytes, 8);
  CheckSides("depth", width, height);
  cv::Mat depth = cv::Mat::zeros(static_cast<int>(height), static_cast<int>(width), CV_16UC1);
  std::uint16_t* at = depth.ptr<std::uint16_t>();
  std::size_t left = depth.total();
  PieceReader reader(bytes);
  std::int32_t previous = 0;
  while (left > 0) {
    const std::size_t before = left;
    const std::uint32_t zeros = reader.Read(kMaxRunPieces);
    if (zeros > left) Broken("depth", "expected a run that ends in the image");
    at += zeros, left -= zeros;
    const std::uint32_t measured = reader.Read(kMaxRunPieces);
    if (measured > left) Broken("depth", "expected a run that ends in the image");
    for (std::uint32_t i = 0; i < measured; ++i) {
      previous += UnZigZag(reader.Read(kMaxDifferencePieces));
      if (previous < 1 || previous > 65535) Broken("depth", "expected depths of 1 to 65535 mm");
      *at++ = static_cast<std::uint16_t>(previous);
    }
    left -= measured;
    if (left == before) Broken("depth", "expected a run of at least one pixel");
  }
  if (!reader.AtEnd()) Broken("depth", "expected no more bytes after the last pixel");
  return depth;
}

}  // namespace vantage::rgbd
