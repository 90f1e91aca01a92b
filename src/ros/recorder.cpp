#include "ros/recorder.h"

#include <fcntl.h>
#include <ros/console.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <stdexcept>

#include "ros/bag_repair.h"
#include "ros/recording_path.h"
#include "ros/stamps.h"
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

constexpr std::chrono::milliseconds kFlush(400);  // what a killed node loses at most
constexpr std::uint32_t kChunkSize = 768 * 1024;  // rosbag's own [bytes]
// What comes to a message, a connection and a chunk at most beside their own bytes, and what is
// still in buffers of the file.
constexpr double kMessageExtra = 500, kConnectionExtra = 500, kChunkExtra = 150, kBuffered = 8192;

/// Zeros for a file that is not there.
FileIdentity identity_of(const std::string& path) {
  struct stat status;
  if (stat(path.c_str(), &status) != 0) return {};
  return {status.st_dev, status.st_ino};
}

/// What is left in the buffers of a file that this process has open, and cannot close, goes nowhere
/// instead of behind the end of the file.
void disconnect(const FileIdentity& file) {
  const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
  struct stat status;
  for (int number = 3; nowhere >= 0 && number < 4096; ++number) {
    if (number == nowhere || fstat(number, &status) != 0) continue;
    if (FileIdentity{status.st_dev, status.st_ino} == file) dup2(nowhere, number);
  }
  if (nowhere >= 0) ::close(nowhere);
}

constexpr std::int64_t kJump = 100000000;  // what no two threads' times are apart [ns]

}  // namespace

ros::Time BagTime::next(const ros::Time& time) {
  std::int64_t at = in_nanoseconds(std::max<ros::Time>(time, ros::TIME_MIN)) + shift_;
  if (at < last_ - kJump) {
    shift_ += last_ - at;
    at = last_;
  }
  last_ = std::max(at, last_ + 1);
  return ros_time_of(last_);
}

Recorder::Recorder(std::string folder, double queue, double reserve, double limit)
    : folder_(std::move(folder)), queue_limit_(queue), reserve_(reserve), limit_(limit) {}

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
  file_ = identity_of(active);
  size_ = kBuffered;
  index_ = 0;
  written_.clear();
  try {
    bag_ = std::make_unique<rosbag::Bag>();
    bag_->open(active, rosbag::bagmode::Write);
    bag_->setCompression(rosbag::compression::LZ4);
    bag_->setChunkThreshold(kChunkSize);
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
  WallTime flushed = WallClock::now();
  for (;;) {
    if (const WallTime now = WallClock::now(); now - flushed >= kFlush) {
      flushed = now;
      flush();
    }
    std::unique_lock<std::mutex> lock(mutex_);
    wake_.wait_for(lock, kFlush, [this] { return stopping_ || !queue_.empty(); });
    if (queue_.empty()) {
      if (stopping_) return;
      continue;
    }
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
    if (limit_ > 0) check_limit(item);
    item.write(*bag_, item.time);
    if (bag_->getChunkThreshold() == 0) bag_->setChunkThreshold(kChunkSize);
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

void Recorder::flush() {
  const std::string active = status().path + ".active";
  if (!(identity_of(active) == file_)) {
    throw std::runtime_error(active + " is gone: somebody removed it");
  }
  // Ends the chunk. What rosbag keeps of it in memory goes when a chunk grows too large, so the
  // next message is one that is: see write_all().
  bag_->setChunkThreshold(0);
  // This one and the next message's, and those that rosbag ended before.
  struct stat status;
  if (stat(active.c_str(), &status) != 0) return;
  const double size = static_cast<double>(status.st_size) + kBuffered;
  const double chunks = 3 + std::max(0.0, size_ - size) / kChunkSize;
  index_ += chunks * (kChunkExtra + 8 * static_cast<double>(written_.size()));
  size_ = size;
}

void Recorder::check_limit(const Item& item) {
  double bytes = 1.01 * static_cast<double>(item.bytes) + kMessageExtra;  // that do not compress
  if (written_.insert(item.topic).second) {
    const double connection = static_cast<double>(item.definition) + kConnectionExtra;
    bytes += connection;
    index_ += 2 * connection;
  }
  for (const bool sure : {false, true}) {
    if (size_ + bytes + index_ <= limit_) break;
    if (sure) throw std::runtime_error("it has reached recording_limit");
    flush();  // says what compression left of it
  }
  size_ += bytes;
}

std::string Recorder::rescue(const std::string& why) {
  const std::string active = status().path + ".active";
  // Its destructor closes once more, throws again, and would end the program.
  (void)bag_.release();
  disconnect(file_);
  try {
    const BagRepair repaired = repair_bag(active);
    const std::lock_guard<std::mutex> lock(mutex_);
    status_.messages = repaired.messages;
    return "";
  } catch (const std::exception& e) {
    return active + " could not be closed (" + why + ", " + e.what() +
           "): when there is space again, 'rosrun tissue_sim repair_bag " + active +
           "' makes what is in it readable";
  }
}

std::string Recorder::close(const std::string& error) {
  const std::string path = status().path, active = path + ".active";
  const std::string ended = "the recording ended: " + (error.empty() ? "" : error + "; ");
  std::string unclosed;
  try {
    bag_->close();
  } catch (const std::exception& e) {
    unclosed = e.what();
    const std::string lost = rescue(unclosed);
    if (!lost.empty()) return ended + lost;
  }
  if (!(identity_of(active) == file_)) {
    return ended + active + " was removed while it was recorded: what came before is lost";
  }
  try {
    rename_new(active, path);
  } catch (const std::exception& e) {
    return ended + e.what() + "; it is whole";
  }
  if (!error.empty()) return ended + "what came before is in " + path;
  return unclosed.empty() ? "" : ended + unclosed + "; what came before is in " + path;
}

}  // namespace tissue_sim
