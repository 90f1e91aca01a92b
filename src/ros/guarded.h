// Callbacks that nothing thrown leaves: roscpp would end the process.
#pragma once

#include <ros/console.h>
#include <ros/message_event.h>
#include <ros/node_handle.h>

#include <atomic>
#include <cstdint>
#include <exception>
#include <string>
#include <utility>

#include "ros/warn_seldom.h"

namespace tissue_sim {

/// What was thrown out of callbacks since the program began, of all nodes in it: for diagnostics.
inline std::atomic<std::uint64_t>& thrown_in_callbacks() {
  static std::atomic<std::uint64_t> count{0};
  return count;
}

/// Calls f(); what it throws is said, at most once a second, and counted.
template <class F>
void guard(const std::string& what, const F& f) {
  const auto said = [&what](const char* why) {
    ++thrown_in_callbacks();
    WARN_SELDOM(1, "%s is ignored: %s", what.c_str(), why);
  };
  try {
    f();
  } catch (const std::exception& e) {
    said(e.what());
  } catch (...) {
    said("it cannot be used");
  }
}

/// Subscribes to a topic, guarded: f(event) is called with each ros::MessageEvent<const M>.
template <class M, class F>
ros::Subscriber listen(ros::NodeHandle& node, const std::string& topic, std::uint32_t queue, F f,
                       const ros::TransportHints& hints = ros::TransportHints()) {
  using Event = ros::MessageEvent<const M>;
  const std::string what = "a message on " + node.resolveName(topic);
  return node.subscribe<M>(topic, queue,
                           boost::function<void(const Event&)>(
                               [what, f](const Event& event) { guard(what, [&] { f(event); }); }),
                           ros::VoidConstPtr(), hints);
}

}  // namespace tissue_sim
