// Vocabulary files: magic, checksum and size of the rest, then header, nodes, centroids; little-endian.
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <tuple>

#include "model/blobs.h"
#include "recognition/kmeans.h"
#include "recognition/vocabulary_tree.h"

namespace vantage::recognition {
namespace {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "vocabulary files are little-endian");

constexpr char kMagic[] = "vantage-vocab-1\n";
constexpr std::size_t kMagicBytes = sizeof(kMagic) - 1;
constexpr std::uint32_t kMaxNameBytes = 256;
constexpr int kMaxLength = 1 << 16;
const char* const kRemedy = "; make one with vantage vocabulary train";

// Sums up what is written.
class Writer {
 public:
  explicit Writer(std::ostream& stream) : stream_(stream) {}

  void Bytes(const void* bytes, std::size_t count) {
    stream_.write(static_cast<const char*>(bytes), static_cast<std::streamsize>(count));
    checksum_ = model::Checksum(static_cast<const char*>(bytes), count, checksum_);
    size_ += count;
  }
  template <typename Value>
  void Put(Value value) {
    Bytes(&value, sizeof(value));
  }
  std::uint64_t checksum() const { return checksum_; }
  std::uint64_t size() const { return size_; }

 private:
  std::ostream& stream_;
  std::uint64_t checksum_ = model::Checksum(nullptr, 0);
  std::uint64_t size_ = 0;
};

struct Damaged : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// Sums up what is read, never beyond `left` bytes.
class Reader {
 public:
  Reader(std::istream& stream, std::uint64_t bytes) : stream_(stream), left_(bytes) {}

  void Bytes(void* bytes, std::size_t count) {
    if (count > left_) throw Damaged("it ends too early");
    left_ -= count;
    if (!stream_.read(static_cast<char*>(bytes), static_cast<std::streamsize>(count))) throw Damaged("it could not be read");
    checksum_ = model::Checksum(static_cast<const char*>(bytes), count, checksum_);
  }
  template <typename Value>
  Value Get() {
    Value value;
    Bytes(&value, sizeof(value));
    return value;
  }
  std::uint64_t checksum() const { return checksum_; }
  std::uint64_t left() const { return left_; }

 private:
  std::istream& stream_;
  std::uint64_t left_;
  std::uint64_t checksum_ = model::Checksum(nullptr, 0);
};

void Require(bool ok, const char* what) {
  if (!ok) throw Damaged(what);
}

}  // namespace

void VocabularyTree::Save(const std::filesystem::path& file) const {
  const std::filesystem::path part = file.string() + ".part";
  try {
    std::ofstream stream(part, std::ios::binary | std::ios::trunc);
    stream.write(kMagic, kMagicBytes);
    const std::uint64_t unknown[2] = {0, 0};
    stream.write(reinterpret_cast<const char*>(unknown), sizeof(unknown));
    Writer writer(stream);
    writer.Put<std::uint32_t>(static_cast<std::uint32_t>(descriptor_.size()));
    writer.Bytes(descriptor_.data(), descriptor_.size());
    for (const int value : {length_, params_.branching, params_.depth, params_.iterations}) writer.Put<std::int32_t>(value);
    writer.Put<std::uint32_t>(params_.seed);
    writer.Put<std::uint32_t>(static_cast<std::uint32_t>(nodes_.size()));
    std::vector<float> centroids;
    for (const Node& node : nodes_) {  // Children come after their parent, so that reading can add them in order.
      writer.Put(node.first_child);
      writer.Put(node.children);
      writer.Put(node.leaf);
      centroids.resize(static_cast<std::size_t>(node.children) * length_);
      if (node.children > 0) UnpackCentroids(Centroids(node.block), node.children, length_, centroids.data());
      writer.Bytes(centroids.data(), centroids.size() * sizeof(float));
    }
    const std::uint64_t seal[2] = {writer.checksum(), writer.size()};
    stream.seekp(kMagicBytes);
    stream.write(reinterpret_cast<const char*>(seal), sizeof(seal));
    stream.close();
    if (!stream) throw std::runtime_error("could not be written; is there space, and may this folder be written to?");
    std::filesystem::rename(part, file);
  } catch (const std::exception& error) {
    std::error_code ignored;
    std::filesystem::remove(part, ignored);
    throw std::runtime_error(file.string() + ": " + error.what());
  }
}

// Reads the body; every count is held against what is left of the file before memory is asked for.
class VocabularyReader {
 public:
  VocabularyReader(std::istream& stream, std::uint64_t bytes) : reader_(stream, bytes) {}

  // Name and length of the descriptors, which come first.
  std::pair<std::string, int> ReadKind() {
    std::string name(std::min(reader_.Get<std::uint32_t>(), kMaxNameBytes), ' ');
    reader_.Bytes(name.data(), name.size());
    const int length = reader_.Get<std::int32_t>();
    Require(length >= 1 && length <= kMaxLength, "a length is out of range");
    return {name, length};
  }

  VocabularyTree Read() {
    VocabularyTree tree;
    std::tie(tree.descriptor_, tree.length_) = ReadKind();
    tree.params_.branching = reader_.Get<std::int32_t>();
    tree.params_.depth = reader_.Get<std::int32_t>();
    tree.params_.iterations = reader_.Get<std::int32_t>();
    tree.params_.seed = reader_.Get<std::uint32_t>();
    try {
      tree.params_.Check();
    } catch (const std::invalid_argument& error) {
      throw Damaged(error.what());
    }
    const std::uint32_t count = reader_.Get<std::uint32_t>();
    Require(count >= 1 && count <= reader_.left() / (3 * sizeof(std::int32_t)), "a count is out of range");
    tree.nodes_.resize(count);
    tree.nodes_[0].depth = 0;
    std::uint32_t expected_child = 1, leaves = 0;
    for (std::uint32_t n = 0; n < count; ++n) leaves += ReadNode(tree, n, expected_child);
    Require(expected_child == count, "nodes are missing");
    for (std::uint32_t n = 0; n < count; ++n) {
      const VocabularyTree::Node& node = tree.nodes_[n];
      if (node.children > 0) continue;
      Require(node.leaf >= 0 && static_cast<std::uint32_t>(node.leaf) < leaves, "a leaf is out of range");
      tree.leaf_nodes_.resize(leaves, -1);
      Require(tree.leaf_nodes_[node.leaf] < 0, "a leaf is there twice");
      tree.leaf_nodes_[node.leaf] = static_cast<std::int32_t>(n);
    }
    return tree;
  }

  const Reader& reader() const { return reader_; }

 private:
  // Returns whether it is a leaf.
  bool ReadNode(VocabularyTree& tree, std::uint32_t n, std::uint32_t& expected_child) {
    VocabularyTree::Node& node = tree.nodes_[n];
    node.first_child = reader_.Get<std::int32_t>();
    node.children = reader_.Get<std::int32_t>();
    node.leaf = reader_.Get<std::int32_t>();
    if (node.children == 0) return true;
    Require(node.children >= 2 && node.children <= tree.params_.branching, "a node's children are out of range");
    const std::int64_t first = node.first_child, end = first + node.children;
    Require(first > n && end <= static_cast<std::int64_t>(tree.nodes_.size()), "a node's children are not in the file");
    expected_child += static_cast<std::uint32_t>(node.children);
    centroids_.resize(static_cast<std::size_t>(node.children) * tree.length_);
    reader_.Bytes(centroids_.data(), centroids_.size() * sizeof(float));
    node.block = tree.AddBlocks(node.children);
    PackCentroids(centroids_.data(), node.children, tree.length_, tree.Centroids(node.block));
    for (std::int64_t c = first; c < end; ++c) {
      Require(tree.nodes_[c].depth == 0, "a node has two parents");
      tree.nodes_[c].depth = node.depth + 1;
    }
    return false;
  }

  Reader reader_;
  std::vector<float> centroids_;
};

namespace {

// What is before the body.
struct Seal {
  std::uint64_t checksum = 0;  // Of the body.
  std::uint64_t bytes = 0;     // Of the body.
};

Seal OpenFile(const std::filesystem::path& file, std::ifstream& stream) {
  const std::string name = file.string();
  stream.open(file, std::ios::binary);
  if (!stream || std::filesystem::is_directory(file)) {
    throw std::runtime_error(name + ": expected a vocabulary file, found none" + kRemedy);
  }
  char magic[kMagicBytes] = {};
  Seal seal;
  stream.read(magic, kMagicBytes);
  if (!stream || std::memcmp(magic, kMagic, kMagicBytes) != 0) {
    throw std::runtime_error(name + ": expected a vocabulary file, found something else" + kRemedy);
  }
  stream.read(reinterpret_cast<char*>(&seal), sizeof(seal));
  const std::uint64_t size = std::filesystem::file_size(file), expected = kMagicBytes + sizeof(seal) + seal.bytes;
  if (!stream || size != expected) {
    throw std::runtime_error(name + ": the vocabulary is damaged: expected " + std::to_string(expected) + " bytes, found " +
                             std::to_string(size) + "; copy it again, or" + (kRemedy + 1));
  }
  return seal;
}

void CheckKind(const std::filesystem::path& file, const std::string& descriptor, int length, const std::string& found,
               int found_length) {
  if ((descriptor.empty() || found == descriptor) && (length == 0 || found_length == length)) return;
  const auto kind = [](const std::string& name, int values) {
    return name + " descriptors" + (values > 0 ? " of " + std::to_string(values) + " values" : "");
  };
  throw std::runtime_error(file.string() + ": expected a vocabulary of " + kind(descriptor, length) + ", found one of " +
                           kind(found, found_length) +
                           "; train one with these features (vantage vocabulary train), or change the features");
}

std::runtime_error DamageOf(const std::filesystem::path& file, const Damaged& error) {
  return std::runtime_error(file.string() + ": the vocabulary is damaged: " + error.what() + "; copy it again, or" + (kRemedy + 1));
}

}  // namespace

VocabularyTree VocabularyTree::Load(const std::filesystem::path& file, const std::string& descriptor, int length) {
  std::ifstream stream;
  const Seal seal = OpenFile(file, stream);
  try {
    VocabularyReader body(stream, seal.bytes);
    VocabularyTree tree = body.Read();
    Require(body.reader().left() == 0, "bytes are left over");
    Require(body.reader().checksum() == seal.checksum, "its checksum does not match");
    CheckKind(file, descriptor, length, tree.descriptor_, tree.length_);
    return tree;
  } catch (const Damaged& error) {
    throw DamageOf(file, error);
  }
}

void VocabularyTree::CheckFile(const std::filesystem::path& file, const std::string& descriptor) {
  std::ifstream stream;
  const Seal seal = OpenFile(file, stream);
  try {
    VocabularyReader body(stream, seal.bytes);
    const auto [name, length] = body.ReadKind();
    CheckKind(file, descriptor, 0, name, length);
  } catch (const Damaged& error) {
    throw DamageOf(file, error);
  }
}

}  // namespace vantage::recognition
