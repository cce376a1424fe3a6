// A computation beside tracking whose result is taken at a stated frame: the same on every run, however fast the machine.
#pragma once

#include <cstdint>
#include <functional>
#include <future>
#include <optional>

namespace vantage::learning {

template <typename Result>
class Background {
 public:
  bool busy() const { return future_.valid(); }

  // Starts the job on a thread of its own; not while busy. It must own what it reads.
  void Start(std::int64_t effect_frame, std::function<Result()> job) {
    effect_frame_ = effect_frame;
    future_ = std::async(std::launch::async, std::move(job));
  }

  // The result once frame `frame` has come to the stated one; waits where the job is not done by then. Throws what the job threw.
  std::optional<Result> Take(std::int64_t frame) {
    if (!busy() || frame < effect_frame_) return std::nullopt;
    return future_.get();
  }

  // Waits for the result, whatever the frame; nullopt where there is no job.
  std::optional<Result> Finish() {
    if (!busy()) return std::nullopt;
    return future_.get();
  }

 private:
  std::int64_t effect_frame_ = 0;
  std::future<Result> future_;
};

}  // namespace vantage::learning
