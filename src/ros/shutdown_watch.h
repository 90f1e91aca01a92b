// ShutdownWatch: work that takes long ends when ROS shuts down.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

namespace tissue_sim {

/// Looks in a thread of its own, ten times a second, whether ROS is shutting down.
class ShutdownWatch {
 public:
  static constexpr double kPatience = 5;  ///< [s]

  ShutdownWatch();
  ~ShutdownWatch();
  ShutdownWatch(const ShutdownWatch&) = delete;
  ShutdownWatch& operator=(const ShutdownWatch&) = delete;

  /// True from when ROS shuts down, or stop() was called, on.
  const std::atomic<bool>& stopping() const { return stopping_; }
  void stop() { stopping_ = true; }
  /// Where this still lives kPatience after a shutdown began, `last_words` is called, which has ten
  /// seconds, and the process ends: for an executable, whose user wants it to.
  void end_process(std::function<void()> last_words);

 private:
  void run();
  bool wait(double seconds);  // false where this is destroyed

  std::atomic<bool> stopping_{false};
  std::mutex mutex_;  // of what follows
  std::condition_variable wake_;
  bool over_ = false;
  std::function<void()> last_words_;
  std::thread thread_;
};

}  // namespace tissue_sim
