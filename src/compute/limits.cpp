#include "tissue_sim/limits.h"

namespace tissue_sim {
namespace {

using Clock = std::chrono::steady_clock;

thread_local WorkLimits limits_of_thread;

}  // namespace

LimitWork::LimitWork(const WorkLimits& limits) : before_(limits_of_thread) {
  limits_of_thread = limits;
}

LimitWork::~LimitWork() { limits_of_thread = before_; }

const WorkLimits& work_limits() { return limits_of_thread; }

WorkLimits with_points(std::int64_t max_points) {
  WorkLimits limits = limits_of_thread;
  limits.max_points = max_points;
  return limits;
}

void stop_if_asked(const WorkLimits& limits) {
  if (limits.stop != nullptr && limits.stop->load(std::memory_order_relaxed)) {
    throw Stopped("stopped before it was done, as was asked");
  }
  if (limits.deadline != Clock::time_point::max() && Clock::now() > limits.deadline) {
    throw Stopped("it took too long and was stopped: take less points, or larger cells");
  }
}

void stop_if_asked() { stop_if_asked(limits_of_thread); }

}  // namespace tissue_sim
