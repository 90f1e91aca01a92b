// What work of this library may take, and the way to end it early.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <stdexcept>

namespace tissue_sim {

/// Of the calls of one thread, while a LimitWork lives there. Where they end work it throws
/// Stopped, within a second or so; a simulation that was stopped within a frame must not be used
/// any more.
struct WorkLimits {
  const std::atomic<bool>* stop = nullptr;  ///< once it is true, work ends
  std::int64_t max_points = 200'000'000;    ///< of all bodies of a scene
  /// When work ends at the latest: building, reading, cutting, frames.
  std::chrono::steady_clock::time_point deadline = std::chrono::steady_clock::time_point::max();
};

/// Thrown where WorkLimits ask for it.
struct Stopped : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Thrown for a scene of more points than WorkLimits have.
struct TooLarge : std::invalid_argument {
  using std::invalid_argument::invalid_argument;
};
/// Thrown for a scene that takes more memory than the GPU has.
struct OutOfMemory : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Sets the limits of this thread until it goes; then those before hold again.
class LimitWork {
 public:
  explicit LimitWork(const WorkLimits& limits);
  ~LimitWork();
  LimitWork(const LimitWork&) = delete;
  LimitWork& operator=(const LimitWork&) = delete;

 private:
  WorkLimits before_;
};

/// Of this thread; a thread that it starts has others, so loops over all cores take a copy along.
const WorkLimits& work_limits();
/// The same but for less points.
WorkLimits with_points(std::int64_t max_points);
/// Throws Stopped where the limits, this thread's by default, ask for it.
void stop_if_asked(const WorkLimits& limits);
void stop_if_asked();

}  // namespace tissue_sim
