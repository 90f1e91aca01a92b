// The simulated time of a node that is the clock, on /clock.
#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/time.h>

namespace tissue_sim {

/// Who subscribes to /clock has no time before the first message, which jumps. A client of CRTK
/// takes that jump, from 0, for waiting: its check_connections() times out unless all else is
/// connected by then, and rospy connects all topics of a node side by side. So time stands for a
/// moment when somebody comes; simulated time has no hole. For the same reason it is not latched.
class ClockTopic {
 public:
  void advertise(ros::NodeHandle& node);
  /// From one thread; as often as one likes.
  void say(const ros::Time& now);

 private:
  ros::Publisher publisher_;
  std::uint32_t known_ = 0;  // subscribers that have been waited for
  ros::Time last_;
  ros::WallTime said_;
};

}  // namespace tissue_sim
