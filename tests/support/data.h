// Where the real recordings are, for tests.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

namespace vantage::testing {

// $VANTAGE_DATA, else ../shared/data beside the source tree.
inline std::filesystem::path DataFolder() {
  const char* folder = std::getenv("VANTAGE_DATA");
  return folder ? std::filesystem::path(folder) : std::filesystem::path(VANTAGE_SOURCE_DIR) / ".." / "shared" / "data";
}

}  // namespace vantage::testing

// Skips the test with a visible word where `part` of the data is absent; with VANTAGE_REQUIRE_DATA=1 that is a failure.
#define VANTAGE_NEEDS_DATA(part)                                                                            \
  if (!std::filesystem::exists(vantage::testing::DataFolder() / (part))) {                                  \
    const char* required = std::getenv("VANTAGE_REQUIRE_DATA");                                             \
    if (required && std::string(required) == "1")                                                           \
      FAIL() << "no " << (part) << " in " << vantage::testing::DataFolder() << " (VANTAGE_REQUIRE_DATA=1)"; \
    GTEST_SKIP() << "no " << (part) << " in " << vantage::testing::DataFolder() << ": set VANTAGE_DATA";    \
  }
