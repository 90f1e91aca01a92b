#include "ros/shutdown_watch.h"

#include <ros/init.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>

namespace tissue_sim {

ShutdownWatch::ShutdownWatch() : thread_(&ShutdownWatch::run, this) {}

ShutdownWatch::~ShutdownWatch() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    over_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

void ShutdownWatch::end_process(std::function<void()> last_words) {
  const std::lock_guard<std::mutex> lock(mutex_);
  last_words_ = std::move(last_words);
}

bool ShutdownWatch::wait(double seconds) {
  std::unique_lock<std::mutex> lock(mutex_);
  return !wake_.wait_for(lock, std::chrono::duration<double>(seconds), [this] { return over_; });
}

void ShutdownWatch::run() {
  while (!ros::isShuttingDown()) {
    if (!wait(0.1)) return;
  }
  stopping_ = true;
  if (!wait(kPatience)) return;
  std::function<void()> last_words;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!last_words_) return;
    last_words = last_words_;
  }
  // Not by ROS_ERROR, which is gone with ROS.
  std::fprintf(stderr, "still busy %g s after the shutdown: ends at once\n", kPatience);
  std::atomic<bool> done{false};
  std::thread([&done, last_words] {
    last_words();
    done = true;
  }).detach();
  for (int i = 0; i < 100 && !done; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  _exit(3);
}

}  // namespace tissue_sim
