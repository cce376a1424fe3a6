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
  int pace_us = 0;              // Between the messages of a frame, where they go over a network; in [0, 10000].
  bool raw = false;             // Images as they are, 1.5 MB a frame: nothing is lost in JPEG, the kernel needs raised limits.

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
  void SendImage(const std::string& channel, const image_part_t& header, const std::vector<std::uint8_t>& bytes);

  Bus& bus_;
  FrameSenderParams params_;
  bool over_network_;
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
    std::size_t bytes = 0;   // In the parts that are there.
    std::int64_t order = 0;  // Of arrival.
  };
  std::map<std::int64_t, Partial> partials_;  // By utime.
  std::int64_t arrivals_ = 0;
};

// A frame as it arrived.
struct ReceivedFrame {
  rgbd::Frame frame;  // id: the source's frame number.
  std::int64_t sequence = 0;
  std::vector<std::uint8_t> encoded_color;  // The JPEG or PNG it came as; empty where it came raw.
};

// A message older than the newest by at most this is late; by more, and its sender was started again, or a log is played.
inline constexpr std::int64_t kMaxLateness_us = 5000000;

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
  std::int64_t gaps() const;                         // Frames that did not arrive whole, of those after the first part.
  std::int64_t skipped() const { return skipped_; }  // Replaced by a newer one before they were taken.
  std::int64_t bad() const { return bad_colors() + bad_depths(); }  // Messages refused, frames that could not be decoded.
  std::int64_t bad_colors() const { return color_.refused + color_.counts->bad; }
  std::int64_t bad_depths() const { return depth_.refused + depth_.counts->bad; }
  // Images of either channel that did not arrive whole, by the sequence numbers of those that did.
  std::int64_t lost_colors() const { return color_.AllLost(); }
  std::int64_t lost_depths() const { return depth_.AllLost(); }
  std::string last_error() const;

 private:
  struct EncodedFrame {
    EncodedImage color;
    EncodedImage depth;  // No bytes: none.
  };

  struct Waiting {
    EncodedImage image;
    std::int64_t order = 0;  // Of arrival.
  };
  // One of the two channels.
  struct Half {
    std::string channel;
    ImageAssembler parts;
    std::map<std::int64_t, Waiting> whole;  // Waiting for their other half; by utime.
    std::int64_t last_sequence = -1;        // Of the newest whole one; without one, of the first part; -1: none.
    std::int64_t newest_sequence = -1;      // Of any part.
    std::int64_t lost = 0;
    std::int64_t refused = 0;
    const SubscriptionCounts* counts = nullptr;

    // With those after the newest whole one, of which something has come but never all.
    std::int64_t AllLost() const;
  };

  void OnPart(const image_part_t& part, Half& half);
  void Pair(std::int64_t utime);
  void Restart();
  void Complete(EncodedFrame frame);
  void Refuse(Half& half, const std::string& why);

  Half color_;
  Half depth_;
  std::int64_t arrivals_ = 0;
  std::optional<EncodedFrame> newest_;
  std::int64_t last_sequence_ = -1;
  std::int64_t last_utime_ = 0;
  std::int64_t frames_ = 0;
  std::int64_t gaps_ = 0;
  std::int64_t skipped_ = 0;
  std::string last_refusal_;
};

}  // namespace vantage::messaging
