// What a structured-light RGB-D camera makes of a perfect picture: noise, holes, range. Internal to simulation.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "geometry/rigid.h"
#include "rendering/scene.h"
#include "simulation/simulated_world.h"

namespace vantage::simulation {

// Standard normal numbers, fast: drawn from a table by a counter-based stream (SplitMix64; Steele, Lea and Flood, 2014).
class NoiseTable {
 public:
  NoiseTable();

  class Stream {
   public:
    float Next();

   private:
    friend class NoiseTable;
    Stream(const std::vector<float>& table, std::uint64_t state) : table_(table), state_(state) {}
    const std::vector<float>& table_;
    std::uint64_t state_;
    std::uint64_t bits_ = 0;
    int left_ = 0;
  };
  Stream StreamOf(std::uint64_t seed) const { return {table_, seed}; }

 private:
  std::vector<float> table_;
};

// One number of a pose and a seed.
std::uint64_t SeedOf(const geometry::Rigid& pose, std::uint32_t seed);

// CV_16UC1, millimetres, 0 = none: out of range, at grazing angles, behind and at depth jumps, in the projector's or the infrared
// camera's shadow. About 20 ms for 640 x 480.
cv::Mat MeasuredDepth(const rendering::Image& image, const SensorParams& params, NoiseTable::Stream noise);

// Adds Gaussian noise to a CV_8UC3 image.
void AddImageNoise(double sigma, NoiseTable::Stream noise, cv::Mat* image);

}  // namespace vantage::simulation
