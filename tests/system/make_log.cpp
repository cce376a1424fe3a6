// make_log FILE FRAMES STAND STEP_DEG: a log of simulated frames, for tests of replay.
#include <cstdio>
#include <cstdlib>
#include <exception>

#include "simulated_log.h"

int main(int argc, char** argv) {
  if (argc != 5) {
    std::fprintf(stderr, "usage: make_log FILE FRAMES STAND STEP_DEG\n");
    return 1;
  }
  try {
    vantage::testing::WriteSimulatedLog(argv[1], std::atoi(argv[2]), std::atoi(argv[3]), std::atof(argv[4]));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "make_log: %s\n", error.what());
    return 1;
  }
  return 0;
}
