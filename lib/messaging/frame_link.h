// RGB-D frames over the bus: encoded, split so that every message arrives, put together and paired again; losses are counted.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vantage/image_part_t.hpp>
#include <vector>

#include "messaging/bus.h"
#include "messaging/result.h"
#include "rgbd/frame.h"

namespace vantage::messaging {

template <>
bool PlausibleBytes<image_part_t>(const void* data, std::uint32_t size);

inline constexpr int kMaxEncodedImageBytes = 32 << 20;

// What contradicts itself in one part of an image; empty where nothing does.
std::string WhyNotAPart(const image_part_t& part);

struct FrameSenderParams {
  int jpeg_quality = 92;        // 1..100.
  int max_part_bytes = 180000;  // Of image data per message; in [1000, kMaxMessageBytes - 1000].

  void Check() const;  // Throws std::invalid_argument naming the field.
};

// Sends frames as SENSOR_COLOR and SENSOR_DEPTH.
class FrameSender {
 public:
  FrameSender(Bus& bus, const FrameSenderParams& params = {});

  // Returns the sequence number the frame was given. A frame without depth is sent without. Throws std::invalid_argument for a
  // frame that is not consistent (rgbd::CheckFrame). Cost: JPEG and RVL of the frame, about 8 ms for 640 x 480.
  std::int64_t Send(const rgbd::Frame& frame);

 private:
  Bus& bus_;
  FrameSenderParams params_;
  std::int64_t next_sequence_ = 0;
};

// One encoded image, complete.
struct EncodedImage {
  image_part_t header{};  // Of its first part; `data` is empty.
  std::vector<std::uint8_t> bytes;
};

// Splits into parts of at most `max_part_bytes`. `header`: utime, sequence, frame_id, encoding, with_depth, camera, pose.
std::vector<image_part_t> SplitImage(const image_part_t& header, const std::vector<std::uint8_t>& bytes, int max_part_bytes);

// Puts parts together, in any order, several images at a time.
class ImageAssembler {
 public:
  // The image this part completes; no value and no error while parts are missing. Errors: sizes that contradict each other or pass
  // kMaxEncodedImageBytes.
  Result<std::optional<EncodedImage>> Add(const image_part_t& part);
  // Forgets images captured at or before this time.
  void DropUntil(std::int64_t utime);

 private:
  struct Partial {
    image_part_t header;
    std::vector<std::vector<std::uint8_t>> parts;
    int missing = 0;
  };
  std::map<std::int64_t, Partial> partials_;  // By utime.
};

// A frame as it arrived.
struct ReceivedFrame {
  rgbd::Frame frame;  // id: the source's frame number.
  std::int64_t sequence = 0;
  std::vector<std::uint8_t> encoded_color;  // The JPEG or PNG it came as.
};

// Receives frames; keeps only the newest whole one. A frame of which a part or the depth is missing is never handed out.
class FrameReceiver {
 public:
  // Subscribes. The bus must outlive the receiver, and the receiver the last Handle.
  explicit FrameReceiver(Bus& bus);
  FrameReceiver(const FrameReceiver&) = delete;
  FrameReceiver& operator=(const FrameReceiver&) = delete;

  bool HasNew() const { return newest_.has_value(); }
  // Capture time of what Take would return; 0 where there is nothing.
  std::int64_t newest_utime() const { return newest_ ? newest_->color.header.utime : 0; }
  // The newest frame not yet taken, decoded; nullopt where there is none or it cannot be decoded (counted as bad).
  std::optional<ReceivedFrame> Take();

  // Forgets what Take would return; not counted as skipped.
  void Drop() { newest_.reset(); }

  std::int64_t frames() const { return frames_; }    // Whole ones that arrived.
  std::int64_t gaps() const { return gaps_; }        // Frames that did not arrive whole.
  std::int64_t skipped() const { return skipped_; }  // Replaced by a newer one before they were taken.
  std::int64_t bad() const;                          // Messages refused, frames that could not be decoded.
  std::string last_error() const;

 private:
  struct EncodedFrame {
    EncodedImage color;
    EncodedImage depth;  // No bytes: none.
  };

  void OnPart(const image_part_t& part, bool is_depth);
  void Pair(std::int64_t utime);
  void Restart();
  void Complete(EncodedFrame frame);
  void Refuse(const std::string& why);

  ImageAssembler color_parts_;
  ImageAssembler depth_parts_;
  std::map<std::int64_t, EncodedImage> colors_;  // Complete, waiting for their other half; by utime.
  std::map<std::int64_t, EncodedImage> depths_;
  std::optional<EncodedFrame> newest_;
  std::int64_t last_sequence_ = -1;
  std::int64_t last_utime_ = 0;
  std::int64_t frames_ = 0;
  std::int64_t gaps_ = 0;
  std::int64_t skipped_ = 0;
  std::int64_t refused_ = 0;
  std::string last_refusal_;
  const SubscriptionCounts* color_counts_;
  const SubscriptionCounts* depth_counts_;
};

}  // namespace vantage::messaging
