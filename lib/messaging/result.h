// A value read from a message, or why there is none.
#pragma once

#include <optional>
#include <string>
#include <utility>

namespace vantage::messaging {

template <typename T>
struct Result {
  std::optional<T> value;
  std::string error;  // What was expected and found; empty where there is a value.

  Result(T v) : value(std::move(v)) {}  // NOLINT: a value is a result.
  static Result Error(std::string text) { return Result(std::nullopt, std::move(text)); }

  explicit operator bool() const { return value.has_value(); }
  const T& operator*() const { return *value; }
  T& operator*() { return *value; }
  const T* operator->() const { return &*value; }

 private:
  Result(std::nullopt_t, std::string text) : error(std::move(text)) {}
};

}  // namespace vantage::messaging
