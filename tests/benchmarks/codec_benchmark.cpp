// The depth codec beside RVL as its paper lists it (A. D. Wilson, "Fast lossless depth image compression", 2017), on simulated
// views with a Kinect's errors. `ratio`: bytes of the raw image over those of the encoded one. Processor time.
#include <benchmark/benchmark.h>

#include <vector>

#include "features/memory.h"
#include "rgbd/codec.h"
#include "simulation/simulated_world.h"

namespace {

using vantage::rgbd::Bytes;

[[maybe_unused]] const bool kAsTheProgramsDo = (vantage::features::KeepFreedMemory(), true);

// The paper's encoder: pieces of 4 bits gathered in 32-bit words.
class WilsonEncoder {
 public:
  std::vector<std::uint32_t> Encode(const cv::Mat& depth) {
    words_.clear();
    words_.reserve(depth.total() / 2);
    word_ = 0;
    pieces_ = 0;
    const auto* at = depth.ptr<std::uint16_t>();
    const auto* const end = at + depth.total();
    std::int32_t previous = 0;
    while (at != end) {
      std::uint32_t zeros = 0, values = 0;
      for (; at != end && !*at; ++at) ++zeros;
      Write(zeros);
      for (const auto* ahead = at; ahead != end && *ahead; ++ahead) ++values;
      Write(values);
      for (std::uint32_t i = 0; i < values; ++i, ++at) {
        const std::int32_t difference = *at - previous;
        Write(static_cast<std::uint32_t>((difference << 1) ^ (difference >> 31)));
        previous = *at;
      }
    }
    if (pieces_) words_.push_back(word_ << 4 * (8 - pieces_));
    return words_;
  }

 private:
  void Write(std::uint32_t value) {
    do {
      std::uint32_t piece = value & 7u;
      if (value >>= 3) piece |= 8u;
      word_ = word_ << 4 | piece;
      if (++pieces_ == 8) {
        words_.push_back(word_);
        pieces_ = 0;
        word_ = 0;
      }
    } while (value);
  }

  std::vector<std::uint32_t> words_;
  std::uint32_t word_ = 0;
  int pieces_ = 0;
};

class WilsonDecoder {
 public:
  cv::Mat Decode(const std::vector<std::uint32_t>& words, int width, int height) {
    next_ = words.data();
    pieces_ = 0;
    cv::Mat depth(height, width, CV_16UC1);
    auto* at = depth.ptr<std::uint16_t>();
    std::int64_t left = static_cast<std::int64_t>(depth.total());
    std::int32_t previous = 0;
    while (left > 0) {
      const std::uint32_t zeros = Read();
      left -= zeros;
      for (std::uint32_t i = 0; i < zeros; ++i) *at++ = 0;
      const std::uint32_t values = Read();
      left -= values;
      for (std::uint32_t i = 0; i < values; ++i) {
        const std::uint32_t code = Read();
        previous += static_cast<std::int32_t>(code >> 1) ^ -static_cast<std::int32_t>(code & 1u);
        *at++ = static_cast<std::uint16_t>(previous);
      }
    }
    return depth;
  }

 private:
  std::uint32_t Read() {
    std::uint32_t value = 0;
    for (int shift = 0;; shift += 3) {
      if (pieces_ == 0) {
        word_ = *next_++;
        pieces_ = 8;
      }
      const std::uint32_t piece = word_ >> 28;
      word_ <<= 4;
      --pieces_;
      value |= (piece & 7u) << shift;
      if (!(piece & 8u)) return value;
    }
  }

  const std::uint32_t* next_ = nullptr;
  std::uint32_t word_ = 0;
  int pieces_ = 0;
};

const std::vector<vantage::rgbd::Frame>& Views() {
  static const auto views = [] {
    const auto params = vantage::simulation::LoadWorldParams(std::string(VANTAGE_SOURCE_DIR) + "/config/worlds/table.yaml");
    const vantage::simulation::SimulatedWorld world(params);
    std::vector<vantage::rgbd::Frame> frames;
    for (int i = 0; i < 6; ++i) {
      const Eigen::AngleAxisd turn(i, Eigen::Vector3d::UnitZ());
      frames.push_back(world.Look(vantage::geometry::Rigid(turn) * world.StartPose(), static_cast<std::uint32_t>(i)));
    }
    return frames;
  }();
  return views;
}

template <typename Work>
void Run(benchmark::State& state, const Work& work) {
  const auto& views = Views();
  std::size_t i = 0;
  double raw = 0.0, encoded = 0.0;
  for (auto _ : state) {
    const auto& depth = views[i++ % views.size()].depth;
    raw += static_cast<double>(2 * depth.total());
    encoded += static_cast<double>(work(depth));
  }
  state.counters["ratio"] = raw / encoded;
}

void EncodeOurs(benchmark::State& state) {
  Run(state, [](const cv::Mat& depth) { return vantage::rgbd::EncodeDepth(depth).size(); });
}
void EncodeWilson(benchmark::State& state) {
  WilsonEncoder encoder;
  Run(state, [&](const cv::Mat& depth) { return 4 * encoder.Encode(depth).size(); });
}
void DecodeOurs(benchmark::State& state) {
  std::vector<Bytes> encoded;
  for (const auto& view : Views()) encoded.push_back(vantage::rgbd::EncodeDepth(view.depth));
  std::size_t i = 0;
  for (auto _ : state) benchmark::DoNotOptimize(vantage::rgbd::DecodeDepth(encoded[i++ % encoded.size()]));
}
void DecodeWilson(benchmark::State& state) {
  WilsonEncoder encoder;
  WilsonDecoder decoder;
  std::vector<std::vector<std::uint32_t>> encoded;
  for (const auto& view : Views()) {
    encoded.push_back(encoder.Encode(view.depth));
    const cv::Mat back = decoder.Decode(encoded.back(), view.depth.cols, view.depth.rows);
    if (cv::norm(back, view.depth, cv::NORM_INF) != 0.0) state.SkipWithError("the reference is wrong");
  }
  std::size_t i = 0;
  for (auto _ : state) benchmark::DoNotOptimize(decoder.Decode(encoded[i++ % encoded.size()], 640, 480));
}
void EncodeColor(benchmark::State& state) {
  std::size_t i = 0;
  double bytes = 0.0;
  for (auto _ : state) {
    bytes += static_cast<double>(
        vantage::rgbd::EncodeColor(Views()[i++ % Views().size()].color, static_cast<int>(state.range(0))).size());
  }
  state.counters["bytes"] = bytes / static_cast<double>(state.iterations());
}

BENCHMARK(EncodeOurs)->Unit(benchmark::kMillisecond)->Repetitions(5)->ReportAggregatesOnly();
BENCHMARK(EncodeWilson)->Unit(benchmark::kMillisecond)->Repetitions(5)->ReportAggregatesOnly();
BENCHMARK(DecodeOurs)->Unit(benchmark::kMillisecond)->Repetitions(5)->ReportAggregatesOnly();
BENCHMARK(DecodeWilson)->Unit(benchmark::kMillisecond)->Repetitions(5)->ReportAggregatesOnly();
BENCHMARK(EncodeColor)->Arg(85)->Arg(92)->Unit(benchmark::kMillisecond);

}  // namespace
