#include "ros/recorder.h"

#include <fcntl.h>
#include <ros/console.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <stdexcept>

#include "ros/recording_path.h"
#include "ros/warn_seldom.h"

namespace tissue_sim {
namespace {

constexpr double kMiB = 1024.0 * 1024.0;

// Nobody who makes the same name at the same time gets the same file.
void create_new(const std::string& path) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL, 0666);
  if (file < 0) {
    throw std::runtime_error("the recording " + path +
                             " cannot be written: " + std::strerror(errno));
  }
  ::close(file);
}

constexpr std::int64_t kJump = 100000000;  // what no two threads' times are apart [ns]

}  // namespace

ros::Time BagTime::next(const ros::Time& time) {
  std::int64_t at =
      static_cast<std::int64_t>(std::max<ros::Time>(time, ros::TIME_MIN).toNSec()) + shift_;
  if (at < last_ - kJump) {
    shift_ += last_ - at;
    at = last_;
  }
  last_ = std::max(at, last_ + 1);
  return ros::Time().fromNSec(static_cast<std::uint64_t>(last_));
}

Recorder::Recorder(std::string folder, double queue, double reserve)
    : folder_(std::move(folder)), queue_limit_(queue), reserve_(reserve) {}

Recorder::~Recorder() {
  try {
    stop();
  } catch (const std::exception&) {  // was not recording, or it has been said
  }
}

std::string Recorder::start(const std::string& name, std::set<std::string> topics) {
  const std::lock_guard<std::mutex> control(control_);
  if (status().recording) throw std::runtime_error("already recording " + status().path);
  if (thread_.joinable()) thread_.join();  // of a recording that ended with an error

  const std::string path = recording_path(folder_, name), active = path + ".active";
  const double left = free_space(path.substr(0, path.rfind('/')));
  if (left < reserve_ + kMiB) {
    char text[200];
    std::snprintf(text, sizeof text,
                  "the disk has %.0f MiB left, and %.0f MiB are to stay free (recording_reserve)",
                  left / kMiB, reserve_ / kMiB);
    throw std::runtime_error(text);
  }
  create_new(active);
  try {
    bag_ = std::make_unique<rosbag::Bag>();
    bag_->open(active, rosbag::bagmode::Write);
    bag_->setCompression(rosbag::compression::LZ4);
  } catch (const std::exception& e) {
    std::remove(active.c_str());
    throw std::runtime_error("the recording " + path + " cannot be written: " + e.what());
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  status_ = RecorderStatus();
  status_.recording = true;
  status_.path = path;
  topics_ = std::move(topics);
  queue_.clear();
  stopping_ = false;
  time_ = {};
  thread_ = std::thread(&Recorder::run, this);
  return path;
}

void Recorder::add(const std::set<std::string>& topics) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (status_.recording && !stopping_) topics_.insert(topics.begin(), topics.end());
}

RecorderStatus Recorder::stop() {
  const std::lock_guard<std::mutex> control(control_);
  if (!thread_.joinable()) throw std::runtime_error("nothing is being recorded");
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
    topics_.clear();
  }
  wake_.notify_one();
  thread_.join();
  const RecorderStatus result = status();
  if (!result.error.empty()) throw std::runtime_error(result.error);
  return result;
}

RecorderStatus Recorder::status() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return status_;
}

bool Recorder::wants(const std::string& topic) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return topics_.count(topic) != 0;
}

void Recorder::push(Item item, bool must_keep) {
  std::string dropped;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (topics_.count(item.topic) == 0) return;
    if (!must_keep && status_.queued + item.bytes > queue_limit_) {
      ++status_.dropped[item.topic];
      dropped = item.topic;
    } else {
      status_.queued += item.bytes;
      item.time = time_.next(item.time);
      queue_.push_back(std::move(item));
    }
  }
  if (dropped.empty()) {
    wake_.notify_one();
  } else {
    WARN_SELDOM(1,
                "The disk is too slow for the recording: a message of %s is lost (see "
                "diagnostics). Record fewer points (cloud_rate, cloud_stride) or topics.",
                dropped.c_str());
  }
}

void Recorder::write_all() {
  const std::string file = status().path + ".active";
  double unchecked = 2 * kMiB;  // bytes written since the disk was asked for its free space
  for (;;) {
    std::unique_lock<std::mutex> lock(mutex_);
    wake_.wait(lock, [this] { return stopping_ || !queue_.empty(); });
    if (queue_.empty()) return;
    const Item item = std::move(queue_.front());
    queue_.pop_front();
    lock.unlock();

    unchecked += item.bytes;
    if (unchecked > 2 * kMiB) {
      unchecked = item.bytes;
      // Stops while there is room for the index, without which no bag can be read.
      if (free_space(file) < reserve_ + 2.0 * item.bytes) {
        throw std::runtime_error("the disk is full up to recording_reserve");
      }
    }
    item.write(*bag_, item.time);
    lock.lock();
    status_.queued -= item.bytes;
    ++status_.messages;
  }
}

void Recorder::run() {
  std::string error;
  try {
    write_all();
  } catch (const std::exception& e) {
    error = e.what();
    const std::lock_guard<std::mutex> lock(mutex_);
    topics_.clear();
    queue_.clear();
    status_.queued = 0;
  }
  const std::string ended = close(error);
  if (!ended.empty()) ROS_ERROR("%s", ended.c_str());
  const std::lock_guard<std::mutex> lock(mutex_);
  topics_.clear();
  status_.recording = false;
  status_.error = ended;
}

std::string Recorder::close(const std::string& error) {
  const std::string path = status().path, active = path + ".active";
  const std::string ended = "the recording ended: " + (error.empty() ? "" : error + "; ");
  try {
    bag_->close();
  } catch (const std::exception& e) {
    // Its destructor closes once more, throws again, and would end the program.
    (void)bag_.release();
    return ended + active + " could not be closed (" + e.what() +
           "): 'rosbag reindex' makes what is in it readable";
  }
  try {
    rename_new(active, path);
  } catch (const std::exception& e) {
    return ended + e.what() + "; it is whole";
  }
  return error.empty() ? "" : ended + "what came before is in " + path;
}

}  // namespace tissue_sim
