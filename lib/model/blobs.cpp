#include "model/blobs.h"

#include <cstdint>
#include <cstring>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

namespace vantage::model {
namespace {

constexpr std::size_t kChecksumBytes = sizeof(std::uint64_t);
constexpr std::size_t kKeypointBytes = 5 * sizeof(float) + 2 * sizeof(std::int32_t);
constexpr int kPointNumbers = 6;

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "the store's bytes are little-endian");

template <typename Value>
void Put(Blob& blob, Value value) {
  blob.append(reinterpret_cast<const char*>(&value), sizeof(value));
}

Blob Seal(Blob blob) {
  Put(blob, Checksum(blob.data(), blob.size()));
  return blob;
}

// Reads values off the bytes before the checksum.
class Reader {
 public:
  explicit Reader(const Blob& blob) : blob_(blob) {
    if (blob.size() < kChecksumBytes) throw std::runtime_error(std::to_string(blob.size()) + " bytes are too few");
    end_ = blob.size() - kChecksumBytes;
    std::uint64_t stored = 0;
    std::memcpy(&stored, blob.data() + end_, kChecksumBytes);
    if (stored != Checksum(blob.data(), end_)) throw std::runtime_error("checksum does not match");
  }

  std::size_t size() const { return end_; }
  const char* data() const { return blob_.data(); }

  // Number of items of that many bytes.
  std::size_t Items(std::size_t item_bytes) const {
    if (end_ % item_bytes != 0) {
      throw std::runtime_error(std::to_string(end_) + " bytes are no multiple of " + std::to_string(item_bytes));
    }
    return end_ / item_bytes;
  }

  void Expect(std::size_t bytes) const {
    if (end_ != bytes) throw std::runtime_error("expected " + std::to_string(bytes) + " bytes, found " + std::to_string(end_));
  }

  template <typename Value>
  Value Next() {
    Value value;
    if (at_ + sizeof(value) > end_) throw std::runtime_error("ends too early");
    std::memcpy(&value, blob_.data() + at_, sizeof(value));
    at_ += sizeof(value);
    return value;
  }

  std::size_t left() const { return end_ - at_; }

 private:
  const Blob& blob_;
  std::size_t end_ = 0;
  std::size_t at_ = 0;
};

}  // namespace

std::uint64_t Checksum(const char* bytes, std::size_t count, std::uint64_t hash) {
  for (std::size_t i = 0; i < count; ++i) hash = (hash ^ static_cast<unsigned char>(bytes[i])) * 1099511628211ull;
  return hash;
}

Blob EncodeImage(const cv::Mat& image) {
  if (image.empty()) return {};
  std::vector<unsigned char> bytes;
  if (!cv::imencode(".png", image, bytes)) throw std::runtime_error("an image could not be compressed");
  return Seal(Blob(bytes.begin(), bytes.end()));
}

cv::Mat DecodeImage(const Blob& blob, int type) {
  if (blob.empty()) return {};
  const Reader reader(blob);
  const cv::Mat bytes(1, static_cast<int>(reader.size()), CV_8UC1, const_cast<char*>(reader.data()));
  cv::Mat image = cv::imdecode(bytes, cv::IMREAD_UNCHANGED);
  if (image.empty()) throw std::runtime_error(std::to_string(reader.size()) + " bytes are no image");
  if (image.type() != type) {
    throw std::runtime_error("expected an image of type " + cv::typeToString(type) + ", found " + cv::typeToString(image.type()));
  }
  return image;
}

Blob EncodeKeypoints(const std::vector<cv::KeyPoint>& keypoints) {
  Blob blob;
  blob.reserve(keypoints.size() * kKeypointBytes + kChecksumBytes);
  for (const cv::KeyPoint& keypoint : keypoints) {
    Put(blob, keypoint.pt.x);
    Put(blob, keypoint.pt.y);
    Put(blob, keypoint.size);
    Put(blob, keypoint.angle);
    Put(blob, keypoint.response);
    Put(blob, static_cast<std::int32_t>(keypoint.octave));
    Put(blob, static_cast<std::int32_t>(keypoint.class_id));
  }
  return Seal(std::move(blob));
}

std::vector<cv::KeyPoint> DecodeKeypoints(const Blob& blob) {
  Reader reader(blob);
  std::vector<cv::KeyPoint> keypoints(reader.Items(kKeypointBytes));
  for (cv::KeyPoint& keypoint : keypoints) {
    keypoint.pt.x = reader.Next<float>();
    keypoint.pt.y = reader.Next<float>();
    keypoint.size = reader.Next<float>();
    keypoint.angle = reader.Next<float>();
    keypoint.response = reader.Next<float>();
    keypoint.octave = reader.Next<std::int32_t>();
    keypoint.class_id = reader.Next<std::int32_t>();
  }
  return keypoints;
}

Blob EncodeDescriptors(const cv::Mat& descriptors) {
  if (!descriptors.empty() && descriptors.type() != CV_32F) {
    throw std::invalid_argument("descriptors must be CV_32F, are " + cv::typeToString(descriptors.type()));
  }
  Blob blob;
  Put(blob, static_cast<std::int32_t>(descriptors.cols));
  const cv::Mat dense = descriptors.isContinuous() ? descriptors : descriptors.clone();
  if (!dense.empty()) blob.append(dense.ptr<char>(), dense.total() * sizeof(float));
  return Seal(std::move(blob));
}

cv::Mat DecodeDescriptors(const Blob& blob, int rows) {
  Reader reader(blob);
  const int columns = reader.Next<std::int32_t>();
  if (columns < 0) throw std::runtime_error("length is negative");
  reader.Expect(sizeof(std::int32_t) + sizeof(float) * static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns));
  cv::Mat descriptors(rows, columns, CV_32F);
  if (!descriptors.empty()) std::memcpy(descriptors.data, reader.data() + sizeof(std::int32_t), reader.left());
  return descriptors;
}

Blob EncodeIndices(const std::vector<int>& indices) {
  Blob blob;
  for (const int index : indices) Put(blob, static_cast<std::int32_t>(index));
  return Seal(std::move(blob));
}

std::vector<int> DecodeIndices(const Blob& blob) {
  Reader reader(blob);
  std::vector<int> indices(reader.Items(sizeof(std::int32_t)));
  for (int& index : indices) index = reader.Next<std::int32_t>();
  return indices;
}

Blob EncodePoints(const std::vector<ModelPoint>& points) {
  Blob blob;
  blob.reserve(points.size() * kPointNumbers * sizeof(double) + kChecksumBytes);
  for (const ModelPoint& point : points) {
    for (int i = 0; i < 3; ++i) Put(blob, point.position[i]);
    for (int i = 0; i < 3; ++i) Put(blob, point.normal[i]);
  }
  return Seal(std::move(blob));
}

std::vector<ModelPoint> DecodePoints(const Blob& blob) {
  Reader reader(blob);
  std::vector<ModelPoint> points(reader.Items(kPointNumbers * sizeof(double)));
  for (ModelPoint& point : points) {
    for (int i = 0; i < 3; ++i) point.position[i] = reader.Next<double>();
    for (int i = 0; i < 3; ++i) point.normal[i] = reader.Next<double>();
  }
  return points;
}

Blob EncodeRigid(const geometry::Rigid& transform) {
  Blob blob;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) Put(blob, transform(row, column));
  }
  return Seal(std::move(blob));
}

geometry::Rigid DecodeRigid(const Blob& blob) {
  Reader reader(blob);
  reader.Expect(16 * sizeof(double));
  geometry::Rigid transform;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) transform(row, column) = reader.Next<double>();
  }
  return transform;
}

Blob EncodeCamera(const geometry::PinholeCamera& camera) {
  Blob blob;
  Put(blob, static_cast<std::int32_t>(camera.width));
  Put(blob, static_cast<std::int32_t>(camera.height));
  for (const double number : {camera.fx, camera.fy, camera.cx, camera.cy}) Put(blob, number);
  return Seal(std::move(blob));
}

geometry::PinholeCamera DecodeCamera(const Blob& blob) {
  Reader reader(blob);
  reader.Expect(2 * sizeof(std::int32_t) + 4 * sizeof(double));
  geometry::PinholeCamera camera;
  camera.width = reader.Next<std::int32_t>();
  camera.height = reader.Next<std::int32_t>();
  camera.fx = reader.Next<double>();
  camera.fy = reader.Next<double>();
  camera.cx = reader.Next<double>();
  camera.cy = reader.Next<double>();
  return camera;
}

}  // namespace vantage::model
