// Draws that are the same with every standard library. Internal to assessment.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <random>

namespace vantage::assessment {

class Dice {
 public:
  explicit Dice(std::initializer_list<std::uint32_t> seeds) {
    std::seed_seq sequence(seeds);
    random_.seed(sequence);
  }
  std::uint32_t Bits() { return static_cast<std::uint32_t>(random_()); }
  double Uniform(double lower, double upper) { return lower + (upper - lower) * (Bits() / 4294967296.0); }
  int Index(int count) { return static_cast<int>(static_cast<std::uint64_t>(Bits()) * static_cast<std::uint64_t>(count) >> 32); }

 private:
  std::mt19937 random_;
};

}  // namespace vantage::assessment
