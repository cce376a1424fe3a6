#include "messaging/frame_link.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <stdexcept>
#include <thread>

#include "messaging/channels.h"
#include "messaging/geometry_messages.h"
#include "rgbd/codec.h"

namespace vantage::messaging {
namespace {

constexpr std::size_t kMaxPending = 8;       // Images waiting for parts or for their other half.
constexpr std::int64_t kMaxMissed = 100000;  // A greater step of the sequence is another sender's.

std::uint32_t BigEndian32(const unsigned char* bytes) {
  return (std::uint32_t{bytes[0]} << 24) | (std::uint32_t{bytes[1]} << 16) | (std::uint32_t{bytes[2]} << 8) | bytes[3];
}

bool SameImage(const image_part_t& a, const image_part_t& b) {
  return a.sequence == b.sequence && a.encoding == b.encoding && a.parts == b.parts && a.total_size == b.total_size &&
         a.camera.width == b.camera.width && a.camera.height == b.camera.height;
}

// Forgets what came first, whatever time it claims to be of.
template <typename Map>
void Limit(Map& map) {
  while (map.size() > kMaxPending) {
    map.erase(
        std::min_element(map.begin(), map.end(), [](const auto& a, const auto& b) { return a.second.order < b.second.order; }));
  }
}

// How many sequence numbers lie between; none where the sender began anew. `last` -1: there was none.
std::int64_t Missed(std::int64_t last, std::int64_t sequence) {
  if (last < 0 || sequence <= last || sequence - last > kMaxMissed) return 0;
  return sequence - last - 1;
}

bool EncodingBelongs(std::int8_t encoding, bool is_depth) {
  if (is_depth) return encoding == image_part_t::DEPTH_RVL || encoding == image_part_t::RAW_DEPTH;
  return encoding == image_part_t::JPEG || encoding == image_part_t::PNG || encoding == image_part_t::RAW_BGR;
}

std::vector<std::uint8_t> RawBytes(const cv::Mat& image) {
  const cv::Mat rows = image.isContinuous() ? image : image.clone();
  return {rows.data, rows.data + rows.total() * rows.elemSize()};
}

cv::Mat FromRaw(const std::vector<std::uint8_t>& bytes, const geometry::PinholeCamera& camera, int type) {
  const std::size_t expected =
      static_cast<std::size_t>(camera.height) * static_cast<std::size_t>(camera.width) * CV_ELEM_SIZE(type);
  if (bytes.size() != expected) {
    throw std::runtime_error("a raw image of " + std::to_string(bytes.size()) + " bytes instead of " + std::to_string(expected));
  }
  cv::Mat image(camera.height, camera.width, type);
  std::copy(bytes.begin(), bytes.end(), image.data);
  return image;
}

Result<rgbd::Frame> Decode(const EncodedImage& color, const EncodedImage& depth) {
  using Frame = Result<rgbd::Frame>;
  const image_part_t& header = color.header;
  const auto camera = FromMessage(header.camera);
  if (!camera) return Frame::Error(camera.error);
  rgbd::Frame frame;
  frame.utime = header.utime;
  frame.id = header.frame_id;
  frame.camera = *camera;
  if (header.T_world_camera_known) {
    const auto pose = FromMessage(header.T_world_camera);
    if (!pose) return Frame::Error(pose.error);
    frame.T_world_camera = *pose;
  }
  try {
    const bool raw_color = color.header.encoding == image_part_t::RAW_BGR;
    frame.color = raw_color ? FromRaw(color.bytes, *camera, CV_8UC3) : rgbd::DecodeColor(color.bytes);
    if (!depth.bytes.empty()) {
      const bool raw_depth = depth.header.encoding == image_part_t::RAW_DEPTH;
      frame.depth = raw_depth ? FromRaw(depth.bytes, *camera, CV_16UC1) : rgbd::DecodeDepth(depth.bytes);
    }
    rgbd::CheckFrame(frame);
  } catch (const std::exception& error) {
    return Frame::Error(error.what());
  }
  return frame;
}

}  // namespace

template <>
bool PlausibleBytes<image_part_t>(const void* data, std::uint32_t size) {
  static const auto header_size = static_cast<std::uint32_t>([] {
    image_part_t empty;
    empty.size = 0;
    return empty.getEncodedSize();
  }());
  if (size < header_size) return false;
  return BigEndian32(static_cast<const unsigned char*>(data) + header_size - 4) == size - header_size;
}

std::string WhyNotAPart(const image_part_t& part) {
  if (part.utime <= 0 || part.sequence < 0) return "an image without a capture time or number";
  if (part.total_size < 1 || part.total_size > kMaxEncodedImageBytes) {
    return "an image of " + std::to_string(part.total_size) + " bytes";
  }
  if (part.parts < 1 || part.part < 0 || part.part >= part.parts || part.size < 1 || part.size > part.total_size) {
    return "part " + std::to_string(part.part) + " of " + std::to_string(part.parts) + " with " + std::to_string(part.size) +
           " bytes";
  }
  return "";
}

void FrameSenderParams::Check() const {
  if (jpeg_quality < 1 || jpeg_quality > 100) throw std::invalid_argument("jpeg_quality must be in 1..100");
  if (max_part_bytes < 1000 || max_part_bytes > kMaxMessageBytes - 1000) {
    throw std::invalid_argument("max_part_bytes must be in [1000, " + std::to_string(kMaxMessageBytes - 1000) + "]");
  }
  if (pace_us < 0 || pace_us > 10000) throw std::invalid_argument("pace_us must be in [0, 10000]");
}

FrameSender::FrameSender(Bus& bus, const FrameSenderParams& params)
    : bus_(bus), params_(params), over_network_(bus.url().rfind("udpm", 0) == 0) {
  params_.Check();
}

std::int64_t FrameSender::Send(const rgbd::Frame& frame) {
  rgbd::CheckFrame(frame);
  image_part_t header;
  header.utime = frame.utime;
  header.sequence = next_sequence_++;
  header.frame_id = frame.id;
  header.with_depth = !frame.depth.empty();
  header.camera = ToMessage(frame.camera);
  header.T_world_camera_known = frame.T_world_camera.has_value();
  header.T_world_camera = ToMessage(frame.T_world_camera.value_or(geometry::Rigid::Identity()));

  header.encoding = params_.raw ? image_part_t::RAW_BGR : image_part_t::JPEG;
  SendImage(kSensorColor, header, params_.raw ? RawBytes(frame.color) : rgbd::EncodeColor(frame.color, params_.jpeg_quality));
  if (header.with_depth) {
    header.encoding = params_.raw ? image_part_t::RAW_DEPTH : image_part_t::DEPTH_RVL;
    SendImage(kSensorDepth, header, params_.raw ? RawBytes(frame.depth) : rgbd::EncodeDepth(frame.depth));
  }
  return header.sequence;
}

void FrameSender::SendImage(const std::string& channel, const image_part_t& header, const std::vector<std::uint8_t>& bytes) {
  for (const auto& part : SplitImage(header, bytes, params_.max_part_bytes)) {
    bus_.Publish(channel, part);
    if (params_.pace_us > 0 && over_network_) std::this_thread::sleep_for(std::chrono::microseconds(params_.pace_us));
  }
}

std::vector<image_part_t> SplitImage(const image_part_t& header, const std::vector<std::uint8_t>& bytes, int max_part_bytes) {
  const int total = static_cast<int>(bytes.size());
  const int parts = std::max(1, (total + max_part_bytes - 1) / max_part_bytes);
  std::vector<image_part_t> result;
  for (int i = 0; i < parts; ++i) {
    image_part_t part = header;
    const auto first = bytes.begin() + static_cast<std::ptrdiff_t>(i) * max_part_bytes;
    const auto last = i + 1 < parts ? first + max_part_bytes : bytes.end();
    part.total_size = total;
    part.part = static_cast<std::int16_t>(i);
    part.parts = static_cast<std::int16_t>(parts);
    part.data.assign(first, last);
    part.size = static_cast<std::int32_t>(part.data.size());
    result.push_back(std::move(part));
  }
  return result;
}

Result<std::optional<EncodedImage>> ImageAssembler::Add(const image_part_t& part) {
  using Image = Result<std::optional<EncodedImage>>;
  const std::string why = WhyNotAPart(part);
  if (!why.empty()) return Image::Error(why);

  auto [entry, is_new] = partials_.try_emplace(part.utime);
  Partial& partial = entry->second;
  if (is_new || !SameImage(partial.header, part)) {
    partial.header = part;
    partial.header.data.clear();
    partial.header.size = 0;
    partial.parts.assign(static_cast<std::size_t>(part.parts), {});
    partial.missing = part.parts;
    partial.bytes = 0;
    partial.order = ++arrivals_;
  }
  auto& slot = partial.parts[static_cast<std::size_t>(part.part)];
  if (slot.empty()) --partial.missing;
  partial.bytes += part.data.size() - slot.size();
  slot = part.data;
  if (partial.bytes > static_cast<std::size_t>(part.total_size)) {
    partials_.erase(entry);
    return Image::Error("an image whose parts make more than its " + std::to_string(part.total_size) + " bytes");
  }
  if (partial.missing > 0) {
    Limit(partials_);
    return std::optional<EncodedImage>();
  }

  EncodedImage image;
  image.header = partial.header;
  for (const auto& piece : partial.parts) image.bytes.insert(image.bytes.end(), piece.begin(), piece.end());
  partials_.erase(entry);
  if (static_cast<std::int32_t>(image.bytes.size()) != image.header.total_size) {
    return Image::Error("an image whose parts make " + std::to_string(image.bytes.size()) + " bytes instead of " +
                        std::to_string(image.header.total_size));
  }
  return std::optional<EncodedImage>(std::move(image));
}

void ImageAssembler::DropUntil(std::int64_t utime) { partials_.erase(partials_.begin(), partials_.upper_bound(utime)); }

FrameReceiver::FrameReceiver(Bus& bus) {
  for (const auto& [half, channel] : {std::pair(&color_, kSensorColor), std::pair(&depth_, kSensorDepth)}) {
    half->channel = channel;
    half->counts = &bus.Subscribe<image_part_t>(channel, [this, to = half](const image_part_t& part) { OnPart(part, *to); });
  }
}

void FrameReceiver::Refuse(Half& half, const std::string& why) {
  ++half.refused;
  last_refusal_ = half.channel + ": " + why;
}

void FrameReceiver::OnPart(const image_part_t& part, Half& half) {
  if (!EncodingBelongs(part.encoding, &half == &depth_)) {
    return Refuse(half, "encoding " + std::to_string(part.encoding) + " is not one for this channel");
  }
  if (frames_ > 0 && part.utime <= last_utime_) {
    if (part.utime == last_utime_) return;  // Doubled.
    if (part.utime > last_utime_ - kMaxLateness_us) {
      return Refuse(half, "utime goes backwards by " + std::to_string(last_utime_ - part.utime) + " us");
    }
    Restart();  // A log is played, or the sender's clock was set.
  }

  auto image = half.parts.Add(part);
  if (!image) return Refuse(half, image.error);
  for (std::int64_t* last : {&half.last_sequence, &last_sequence_}) {
    if (*last < 0) *last = part.sequence;
  }
  half.newest_sequence = part.sequence;
  if (!*image) return;
  half.lost += Missed(half.last_sequence, part.sequence);
  half.last_sequence = part.sequence;
  half.whole[part.utime] = {std::move(**image), ++arrivals_};
  Limit(half.whole);
  Pair(part.utime);
}

std::int64_t FrameReceiver::Half::AllLost() const { return lost + Missed(last_sequence, newest_sequence); }

std::int64_t FrameReceiver::gaps() const {
  return gaps_ + Missed(last_sequence_, std::max(color_.newest_sequence, depth_.newest_sequence));
}

void FrameReceiver::Restart() {
  for (Half* half : {&color_, &depth_}) {
    half->parts.DropUntil(std::numeric_limits<std::int64_t>::max());
    half->whole.clear();
    half->last_sequence = half->newest_sequence = -1;
  }
  last_sequence_ = -1;
  last_utime_ = 0;
}

void FrameReceiver::Pair(std::int64_t utime) {
  const auto color = color_.whole.find(utime);
  if (color == color_.whole.end()) return;
  EncodedFrame frame;
  if (color->second.image.header.with_depth) {
    const auto depth = depth_.whole.find(utime);
    if (depth == depth_.whole.end()) return;
    frame.depth = std::move(depth->second.image);
  }
  frame.color = std::move(color->second.image);
  Complete(std::move(frame));
}

void FrameReceiver::Complete(EncodedFrame frame) {
  const image_part_t& header = frame.color.header;
  gaps_ += Missed(last_sequence_, header.sequence);
  last_sequence_ = header.sequence;
  last_utime_ = header.utime;
  ++frames_;

  // Whatever is older can only be what was lost.
  for (Half* half : {&color_, &depth_}) {
    half->parts.DropUntil(header.utime);
    half->whole.erase(half->whole.begin(), half->whole.upper_bound(header.utime));
  }

  if (newest_) ++skipped_;
  newest_ = std::move(frame);
}

std::optional<ReceivedFrame> FrameReceiver::Take() {
  if (!newest_) return std::nullopt;
  EncodedFrame encoded = std::move(*newest_);
  newest_.reset();
  auto frame = Decode(encoded.color, encoded.depth);
  if (!frame) {
    Refuse(color_, "frame " + std::to_string(encoded.color.header.sequence) + ": " + frame.error);
    return std::nullopt;
  }
  if (encoded.color.header.encoding == image_part_t::RAW_BGR) encoded.color.bytes.clear();
  return ReceivedFrame{std::move(*frame), encoded.color.header.sequence, std::move(encoded.color.bytes)};
}

std::string FrameReceiver::last_error() const {
  if (!last_refusal_.empty()) return last_refusal_;
  return color_.counts->last_error.empty() ? depth_.counts->last_error : color_.counts->last_error;
}

}  // namespace vantage::messaging
