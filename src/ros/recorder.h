// Recorder: writes bags in a thread of its own, from the very messages that are published.
#pragma once

#include <ros/serialization.h>
#include <rosbag/bag.h>

#include <algorithm>
#include <condition_variable>
#include <cstdint>
#include <cstring>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>

namespace tissue_sim {

struct RecorderStatus {
  bool recording = false;
  std::string path;                              ///< of the bag that is written or was written last
  std::uint64_t messages = 0;                    ///< written
  std::uint64_t queued = 0;                      ///< waiting for the disk [bytes]
  std::map<std::string, std::uint64_t> dropped;  ///< by topic: the queue was full
  std::string error;                             ///< what ended the recording before it was stopped
};

/// Times of the messages in a bag. Who reads a bag gets its messages in the order of their times,
/// so those of one that was written later are later, also where a clock stands still (/clock,
/// between two of its messages) or jumps back (a bag that is played in a loop): from there on they
/// go on from where they were.
class BagTime {
 public:
  ros::Time next(const ros::Time& time);

 private:
  std::int64_t last_ = 0, shift_ = 0;  // [ns]
};

/// Which file it is, whatever its name.
struct FileIdentity {
  std::uint64_t device = 0, number = 0;
  bool operator==(const FileIdentity& o) const { return device == o.device && number == o.number; }
};

/// Thread-safe. Nothing but start() and stop() ever waits for the disk.
class Recorder {
 public:
  /// `queue` bytes of messages may wait for the disk; `reserve` bytes of the disk stay free.
  /// A recording ends before its bag has more than `limit` bytes; 0 for none.
  Recorder(std::string folder, double queue, double reserve, double limit = 0);
  /// Ends the recording.
  ~Recorder();

  /// Starts `<folder>/<name>.bag` (see recording_path()), under the name `.bag.active` until it is
  /// closed. Returns its full path; throws std::runtime_error.
  std::string start(const std::string& name, std::set<std::string> topics);
  /// Topics that a recording which runs shall hold, too; nothing if none does.
  void add(const std::set<std::string>& topics);
  /// Writes what is queued and closes the bag; throws std::runtime_error if nothing is recorded, or
  /// if the recording had ended before because of an error.
  RecorderStatus stop();
  RecorderStatus status() const;
  const std::string& folder() const { return folder_; }

  /// Whether messages of this topic are recorded now: nobody else may be listening.
  bool wants(const std::string& topic) const;

  /// Queues the message if its topic is recorded. What `must_keep` is queued even if the queue is
  /// full: the scene and the inputs are small, and without them a bag cannot be run again.
  template <class M>
  void write(const std::string& topic, const boost::shared_ptr<const M>& message,
             const ros::Time& time, bool must_keep = false, bool latched = false) {
    if (!wants(topic)) return;
    const std::uint64_t bytes = ros::serialization::serializationLength(*message);
    boost::shared_ptr<ros::M_string> header;
    if (latched) {
      header = boost::make_shared<ros::M_string>();
      (*header)["type"] = ros::message_traits::datatype(*message);
      (*header)["md5sum"] = ros::message_traits::md5sum(*message);
      (*header)["message_definition"] = ros::message_traits::definition(*message);
      (*header)["latching"] = "1";
    }
    const std::uint64_t definition = std::strlen(ros::message_traits::definition(*message));
    push({topic, bytes, definition, time,
          [=](rosbag::Bag& bag, const ros::Time& at) { bag.write(topic, at, message, header); }},
         must_keep);
  }

 private:
  struct Item {
    std::string topic;
    std::uint64_t bytes, definition;  // of the message, and of the text of its type
    ros::Time time;
    std::function<void(rosbag::Bag&, const ros::Time&)> write;
  };
  void push(Item item, bool must_keep);
  void run();        // the thread
  void write_all();  /// until stop(), or throws
  /// Closes and renames the bag. Returns what there is to say of a recording that `error` ended, or
  /// that this does; else "".
  std::string close(const std::string& error);
  /// The same where rosbag cannot: see repair_bag().
  std::string rescue(const std::string& why);
  /// Ends the chunk, so that all that was written is there whatever becomes of this process. Throws
  /// where the bag is gone.
  void flush();
  /// Throws where the bag, closed after this item, might be larger than the limit.
  void check_limit(const Item& item);

  const std::string folder_;
  const double queue_limit_, reserve_, limit_;  // [bytes]
  std::mutex control_;                          // held by start() and stop()
  std::thread thread_;
  std::unique_ptr<rosbag::Bag> bag_;  // of the thread, while it runs
  FileIdentity file_;                 // the bag's, while it is written
  double size_ = 0;                   // of its file at most, and of the index to come [bytes]
  double index_ = 0;
  std::set<std::string> written_;  // topics

  mutable std::mutex mutex_;  // of what follows
  std::condition_variable wake_;
  std::deque<Item> queue_;
  std::set<std::string> topics_;
  bool stopping_ = false;
  BagTime time_;
  RecorderStatus status_;
};

}  // namespace tissue_sim
