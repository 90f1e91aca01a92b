#include "ros/clock_topic.h"

#include <ros/init.h>
#include <rosgraph_msgs/Clock.h>

namespace tissue_sim {
namespace {

constexpr double kStands = 0.3;  // [s]; rospy connects a topic in some 0.03
constexpr int kMostTimes = 10;   // in turn, whoever comes and goes
constexpr double kAgain = 0.02;  // between two of the same time [s]

}  // namespace

void ClockTopic::advertise(ros::NodeHandle& node) {
  publisher_ = node.advertise<rosgraph_msgs::Clock>("/clock", 10);
  known_ = publisher_.getNumSubscribers();  // this node
}

void ClockTopic::say(const ros::Time& now) {
  bool any_came = false;
  for (int times = 0; times < kMostTimes && ros::ok(); ++times) {
    const std::uint32_t present = publisher_.getNumSubscribers();
    const bool came = present > known_;
    known_ = present;
    if (!came) break;
    any_came = true;
    ros::WallDuration(kStands).sleep();
  }
  const ros::WallTime at = ros::WallTime::now();
  if (!any_came && now == last_ && at - said_ < ros::WallDuration(kAgain)) return;
  last_ = now;
  said_ = at;
  rosgraph_msgs::Clock message;
  message.clock = now;
  publisher_.publish(message);
}

}  // namespace tissue_sim
