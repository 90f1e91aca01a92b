// Output: one topic of the node, published and recorded from the same message.
#pragma once

#include <ros/node_handle.h>

#include <string>

#include "ros/recorder.h"

namespace tissue_sim {

template <class M>
class Output {
 public:
  Output(ros::NodeHandle& node, const std::string& name, int queue, Recorder& recorder,
         bool latch = false)
      : publisher_(node.advertise<M>(name, queue, latch)),
        topic_(node.resolveName(name)),
        latch_(latch),
        recorder_(&recorder) {}

  const std::string& topic() const { return topic_; }
  bool listened() const { return publisher_.getNumSubscribers() > 0; }
  bool recorded() const { return recorder_->wants(topic_); }
  bool wanted() const { return listened() || recorded(); }

  /// Shared, so that nodelets and the recorder get the message without a copy: it must not change
  /// any more. `must_keep`: see Recorder.
  void publish(const boost::shared_ptr<const M>& message, const ros::Time& stamp,
               bool must_keep = false) const {
    publisher_.publish(message);
    recorder_->write(topic_, message, stamp, must_keep, latch_);
  }
  /// Publishes what `make` makes, if anybody wants it; `into_bag`: else to those who listen alone.
  template <class Make>
  void send(bool into_bag, const ros::Time& stamp, Make make) const {
    if (into_bag ? wanted() : listened()) {
      const boost::shared_ptr<const M> message = make();
      into_bag ? publish(message, stamp) : show(message);
    }
  }
  /// To those who listen now, but not into the bag.
  void show(const boost::shared_ptr<const M>& message) const { publisher_.publish(message); }
  /// Into the bag, but to nobody else.
  void record(const boost::shared_ptr<const M>& message, const ros::Time& stamp) const {
    recorder_->write(topic_, message, stamp, true, latch_);
  }

 private:
  ros::Publisher publisher_;
  std::string topic_;
  bool latch_;
  Recorder* recorder_;
};

}  // namespace tissue_sim
